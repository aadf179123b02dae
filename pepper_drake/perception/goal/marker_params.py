"""Parameters of marker detection: thresholds, and errors of corners and edges."""

from dataclasses import dataclass, field

from pepper_drake.errors import InputError
from pepper_drake.short_repr import short_repr


@dataclass
class EdgeParams:
    """Refinement of a marker's pose on the edges of its pattern; see `marker_edges`."""

    longest_search: float = 3.0
    """Largest search range to either side of an edge [pixels]."""
    shortest_search: float = 1.15
    """Search range below which neighbouring edges blur into each other [pixels]."""
    search_ratio: float = 0.45
    """Search range relative to a module; the next edge begins to matter beyond one half."""
    found_fraction: float = 0.9
    """Fraction of the search range within which an edge must be found, to exclude the next one."""
    outlier: float = 0.6
    """Residual beyond which edges are down-weighted [pixels]."""
    min_edges: int = 8
    """Smallest number of module edges to fit a pose."""
    min_error: float = 0.02
    """Smallest error of an edge, whatever the residuals [pixels], ..."""
    neighbours: float = 0.7
    """... and error of an edge due to blurred neighbours for modules one pixel wide [pixels]; it
    falls with the square of the module's width. Measured, like the next, with 840 synthetic markers
    of 17 to 60 pixels, at 0.15 to 2.5 times the light."""
    spill: float = 1.6
    """Standard deviation of the marker's size due to light spill, times a module's width over the
    edges' common offset [pixels]. Measured, like the next, with 2,000 synthetic markers of 13 to 45
    pixels, at 0.15 to 2.5 times the light, with and without bloom and blur."""
    blurred: float = 0.45
    """Standard deviation of the marker's size due to edges that blur into each other [pixels] when
    the width (standard deviation) of an edge's slope is ..."""
    blurred_width: float = 0.23
    """... this fraction of a module's width; ..."""
    blurred_growth: float = 0.0148
    """... for each increase by this it grows by a factor of e."""
    min_exposure_offset: float = 0.14
    """Common offset of all edges towards black or white beyond which the image counts as over- or
    underexposed [pixels]; the offset is then fitted, too."""
    min_contrast: float = 0.35
    """An edge counts as seen when its contrast is at least this fraction of the median one, ..."""
    min_step: float = 10.0
    """... and more than this in grey levels of 0 to 255."""
    min_support: float = 0.8
    """Smallest fraction of the pattern's edges that must be seen."""
    ambiguity_ratio: float = 1.2
    """Ratio of the edge errors above which two poses are distinguished."""


@dataclass
class MarkerParams:
    """Detection of a marker, the noise of its corners, and the choice between its two poses."""

    smallest_side: float = 7.0
    """Shortest side of a trusted marker [pixels]; its bits are then little more than a pixel."""
    corner_sigma: float = 0.2
    """Standard deviation of a corner's coordinate by the first detector [pixels], ..."""
    second_corner_sigma: float = 0.4
    """... by the second, more sensitive one, and for markers smaller than `small_side` by both,
    inversely proportional to the side [pixels]."""
    small_side: float = 20.0
    """Shortest side below which markers are small [pixels]."""
    shrinkage_by_side: float = 3.2
    """Standard deviation of a common inward shift of the corners of a small marker, times its
    shortest side [pixels²]. This and the next five were measured with synthetic markers of 11 to
    21 pixels, at 0.15 and 1 times the light; the variances by side and by noise add up."""
    shrinkage_by_noise: float = 8.0
    """The same, divided by the image's noise relative to its contrast [pixels]."""
    shift_by_side: float = 1.8
    """Twice the standard deviation of a common shift of all corners, times the side [pixels²]."""
    shift_by_noise: float = 5.0
    """The same, divided by the relative noise [pixels]."""
    scatter_by_side: float = 4.2
    """Standard deviation of the rest of each coordinate, times the side [pixels²]."""
    scatter_by_noise: float = 7.0
    """The same, divided by the relative noise [pixels]."""
    shrinkage_by_softness: float = 1.3
    """Standard deviation of the common inward shift per pixel of softness above `sharp`. Measured,
    like the next five, with 1,400 synthetic markers of 13 to 30 pixels, blurred by up to 1.5
    pixels, with up to 2.5 times the light, with and without bloom."""
    shift_by_softness: float = 0.45
    """Twice the standard deviation of the common shift per pixel of softness above `sharp`."""
    sharp: float = 2.05
    """Softness of a sharp image: its contrast divided by its steepest slope [pixels]."""
    saturation_level: float = 254.0
    """Grey level at which a pixel is saturated, allowing for rounding and noise."""
    shrinkage_by_clipping: float = 0.75
    """Standard deviation of the common inward shift if all white pixels are saturated [pixels]."""
    shift_by_clipping: float = 0.3
    """Twice the standard deviation of the common shift in that case [pixels]."""
    largest_soft_side: float = 30.0
    """Shortest side above which softness and saturation are ignored, as all edges are resolved
    [pixels]."""
    largest_error: float = 1.5
    """Largest rms reprojection error of a square's corners for a quadrilateral to be a marker
    [pixels]."""
    ambiguity_ratio: float = 2.5
    """Two poses are distinguished if the errors of their corners differ by this factor, ..."""
    ambiguity_sigmas: float = 1.5
    """... and by more than this many standard deviations of a corner, which is three of the error
    of four corners."""
    systematic_ratio: float = 0.003
    """Standard deviation along the line of sight of the error common to all images (edge sampling
    by the sensor, lens, printed size of the marker), relative to the distance."""
    window_ratio: float = 1.5
    """Half size of the window that is searched first, around the expected marker: this many of the
    marker's sides ..."""
    window_margin: float = 40.0
    """... plus this [pixels]."""
    edges: EdgeParams = field(default_factory=EdgeParams)
    """Refinement of the pose on all edges of the pattern."""

    __repr__ = short_repr

    def check(self) -> None:
        """Raises InputError for sizes, noise or search ranges that make no sense."""
        for name in (
            "smallest_side",
            "small_side",
            "corner_sigma",
            "second_corner_sigma",
            "largest_error",
        ):
            value = getattr(self, name)
            if not value > 0.0:
                raise InputError(f"marker.{name} is {value:g}; it must be positive")
        edges = self.edges
        if not 0.0 < edges.shortest_search < edges.longest_search:
            raise InputError(
                f"marker.edges.shortest_search is {edges.shortest_search:g} pixels; it must be "
                f"positive and less than marker.edges.longest_search, {edges.longest_search:g}"
            )


DEFAULT_MARKER = MarkerParams()
"""Default parameters."""
