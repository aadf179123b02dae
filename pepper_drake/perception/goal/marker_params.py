"""Numbers of finding a marker in an image: which are trusted, and what their corners err."""

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
    search_share: float = 0.45
    """Search range as a share of a module: beyond half of it lies the next edge."""
    found_share: float = 0.9
    """Share of the search range within which an edge must be found: at its end may be another."""
    outlier: float = 0.6
    """Edges found farther than this from where the others put them count less [pixels]."""
    least_edges: int = 8
    """Edges of modules without which no pose is fitted."""
    least_error: float = 0.02
    """Error of an edge that no residual shows [pixels], ..."""
    neighbours: float = 0.7
    """... and that of one whose module is a pixel wide, as the blurred edges beside it draw it
    along [pixels]: it falls with the square of the module's width. Measured, as the next, with 840
    drawn markers of 17 to 60 pixels, at 0.15 to 2.5 times the light."""
    spill: float = 1.6
    """Standard deviation by which light that spills over changes the marker's size, times a
    module's width over the edges' common offset [pixels]. Measured, as the next, with 2,000 drawn
    markers of 13 to 45 pixels, at 0.15 to 2.5 times the light, with and without bloom and blur."""
    blurred: float = 0.45
    """Standard deviation by which edges that blur into each other change the marker's size [pixels]
    where the standard deviation of an edge's slope is ..."""
    blurred_width: float = 0.23
    """... this share of a module's width, ..."""
    blurred_growth: float = 0.0148
    """... and by how much more it grows by a factor of e."""
    least_offset: float = 0.14
    """Edges that are all farther than this towards black or white are of an image exposed too much
    or too little [pixels]: their common offset is then fitted, too."""
    least_contrast: float = 0.35
    """An edge counts as seen when its contrast is at least this share of the median one, ..."""
    least_step: float = 10.0
    """... and more than this in grey levels of 0 to 255."""
    least_support: float = 0.8
    """A pattern of whose edges fewer are seen than this share is hidden, or another one."""
    ambiguity_ratio: float = 1.2
    """Ratio of the errors of all edges from which on two poses are told apart."""


@dataclass
class MarkerParams:
    """Detection of a marker, the noise of its corners, and the choice between its two poses."""

    smallest_side: float = 7.0
    """Markers of a shorter side [pixels] are not trusted: their bits are little more than a
    pixel."""
    corner_sigma: float = 0.2
    """Standard deviation of a corner's coordinate by the first detector [pixels], ..."""
    second_corner_sigma: float = 0.4
    """... by the second, more patient one, and, growing as the side shrinks, by both for markers
    smaller than `small_side` [pixels]."""
    small_side: float = 20.0
    """Shortest side below which markers are small [pixels]."""
    shrinkage_by_side: float = 3.2
    """Standard deviation by which the corners of a small marker are drawn inwards alike, times its
    shortest side [pixels²]. This and the next five were measured with drawn markers of 11 to 21
    pixels, at 0.15 and 1 times the light; each deviation is the root of two squares, of its part
    by the side and its part by the noise."""
    shrinkage_by_noise: float = 8.0
    """The same by the image's noise over its contrast [pixels]."""
    shift_by_side: float = 1.8
    """Twice the standard deviation by which all are shifted alike, times the side [pixels²]."""
    shift_by_noise: float = 5.0
    """The same by the noise over the contrast [pixels]."""
    scatter_by_side: float = 4.2
    """Standard deviation of the rest of each coordinate, times the side [pixels²]."""
    scatter_by_noise: float = 7.0
    """The same by the noise over the contrast [pixels]."""
    shrinkage_by_softness: float = 1.3
    """Standard deviation by which corners are drawn inwards alike, times how much softer its edges
    are than `sharp`. Measured, as the next five, with 1,400 drawn markers of 13 to 30 pixels,
    blurred by up to 1.5 pixels, with up to 2.5 times the light, with and without bloom."""
    shift_by_softness: float = 0.45
    """Twice the standard deviation by which all are shifted alike, times the same."""
    sharp: float = 2.05
    """Softness of a sharp image: its contrast over its steepest slope [pixels]."""
    whitest: float = 254.0
    """Grey level from which a pixel is as white as it can be, by rounding and noise of its
    colours."""
    shrinkage_by_clipping: float = 0.75
    """Standard deviation by which corners are drawn inwards alike where all that is white is as
    white as an image can be [pixels]."""
    shift_by_clipping: float = 0.3
    """Twice the standard deviation by which all are then shifted alike [pixels]."""
    largest_soft_side: float = 30.0
    """Shortest side from which neither of both is counted: all edges are then seen apart [pixels].
    """
    largest_error: float = 1.5
    """A quadrilateral that no square projects to within this rms [pixels] is not a marker."""
    ambiguity_ratio: float = 2.5
    """Two poses are told apart by the errors of four corners that differ by this factor, ..."""
    ambiguity_sigmas: float = 1.5
    """... and by more than so many standard deviations of a corner, which is three of what four of
    them err."""
    systematic_share: float = 0.003
    """Standard deviation along the line of sight of what errs alike in every image (the sampling of
    edges by the sensor, the lens, the marker's printed size), as a share of the distance."""
    window_share: float = 1.5
    """Part of the image that is searched first, around the expected marker, to each side: this many
    of its sides ..."""
    window_margin: float = 40.0
    """... and so much more [pixels]."""
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
"""Parameters of functions that are given none."""
