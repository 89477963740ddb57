from .display.rounding import concise as concise
from .estimation.joint.cramer_rao_bound import bound as bound
from .estimation.joint.priors import Alignment as Alignment
from .estimation.static_poses.centre_result import Centre as Centre
from .exceptions import RunError as RunError
from .identification import identify as identify
from .least_squares.gram import ordinary_least_squares as ordinary_least_squares
from .results.identification_result import Identification as Identification
from .results.weak_components import within_bodies as within_bodies
from .rigid_body.inertia import COMPONENTS as COMPONENTS
from .rigid_body.inertia import GRAM_METRE as GRAM_METRE
from .rigid_body.inertia import Body as Body
from .rigid_body.inertia import pack as pack
from .rigid_body.inertia import parallel_axis as parallel_axis
from .rigid_body.inertia import rotate as rotate
from .rigid_body.inertia import unpack as unpack
from .rigid_body.inertial_parameters import InertialParameters as InertialParameters
from .rigid_body.principal_axes import is_admissible as is_admissible
from .rigid_body.principal_axes import principal as principal
from .rigid_body.pseudo_inertia import log_cholesky as log_cholesky
from .rigid_body.pseudo_inertia import pseudo_inertia as pseudo_inertia
from .rigid_body.regressor import omega_r as omega_r
from .rigid_body.regressor import pi as pi
from .rigid_body.regressor import wrench_regressor as wrench_regressor
from .signals.estimator_spec import EstimatorSpec as EstimatorSpec
from .signals.run import Run as Run

# isort: split
# Until 0.3: names of version 0.1, whose place is their room.
from .floating_point import PrecisionWarning as PrecisionWarning
from .results.run_estimate import RunEstimate as RunEstimate
