"""Configuration of the reach, set by a scenario."""

from dataclasses import dataclass, field

from pepper_drake.diagrams.compliance import ComplianceConfig
from pepper_drake.diagrams.head_perception import PerceptionConfig
from pepper_drake.diagrams.safety_layer import SafetyParams
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams, ReachTiming
from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.planning.reach.task_sequence import SequenceTask
from pepper_drake.planning.safety.contact_detection import ContactParams


@dataclass
class ReachingConfig:
    """Configuration of the reach."""

    station: StationConfig = field(default_factory=StationConfig)
    ik: DifferentialIkParams = field(default_factory=DifferentialIkParams)
    planner: ReachPlannerParams = field(default_factory=ReachPlannerParams)
    planner_class: type[ReachPlanner] = ReachPlanner
    """Class of the planner, constructed from primitive and task."""
    timing: ReachTiming = field(default_factory=ReachTiming)
    perception: PerceptionConfig = field(default_factory=PerceptionConfig)
    safety: SafetyParams = field(default_factory=SafetyParams)
    contact: ContactParams = field(default_factory=ContactParams)
    """Detection of a joint that is held by an obstacle; not used with a compliant arm."""
    compliance: ComplianceConfig | None = None
    """Compliance of the reaching arm while it is pushed; a stiff arm if None."""
    log_period: float = 0.01
    """Period of all logs [s]."""
    tasks: tuple[SequenceTask, ...] = ()
    """Tasks of the arm after the reach, in sequence."""
    is_guided: bool = False
    """True if a person moves objects and arm: nothing moves by itself, and nothing is logged."""
