"""What ``import tablegen`` offers: the one list of public names, in the order in which they are used."""

from tablegen.api.build import (
    load as load,
    plan as plan,
    certify as certify,
    build as build,
)
from tablegen.api.turned import build_turned as build_turned
from tablegen.api.many import (
    variants as variants,
    build_many as build_many,
)
from tablegen.manifest.read import read_build as read_build
from tablegen.verification.run import verify as verify
from tablegen.api.calibrate import (
    calibrate as calibrate,
    calibrate_images as calibrate_images,
)
from tablegen.api.calibrate_operator import calibrate_operator as calibrate_operator
from tablegen.api.calibrate_coupling import calibrate_coupling as calibrate_coupling
from tablegen.api.read_image import (
    channels as channels,
    read_image as read_image,
)
from tablegen.api.lattice import lattice as lattice
from tablegen.api.drift import drift as drift
from tablegen.api.refine import refine as refine
from tablegen.api.refine_turned import refine_turned as refine_turned
from tablegen.api.correct import correct as correct
from tablegen.api.simulate import simulate as simulate
from tablegen.api.simulate_turned import simulate_turned as simulate_turned
from tablegen.api.predict import predict as predict
from tablegen.api.compare import compare as compare
from tablegen.api.tables import tables as tables
from tablegen.api.report import report as report
from tablegen.sweeping.sweep import sweep as sweep
from tablegen.api.laboratory import Laboratory as Laboratory
from tablegen.link.device import Device as Device
from tablegen.device.commit_mode import CommitMode as CommitMode
from tablegen.api.live import (
    Live as Live,
    LiveAxis as LiveAxis,
    LiveScan as LiveScan,
)
from tablegen.api.live_preview import LivePreview as LivePreview
from tablegen.api.live_tilt import LiveZ as LiveZ
from tablegen.config.load import Setup as Setup
from tablegen.planning.line_plan import Plan as Plan
from tablegen.certificate.certificate import Certificate as Certificate
from tablegen.api.build import Build as Build
from tablegen.api.turned import TurnedBuild as TurnedBuild
from tablegen.api.samples import Samples as Samples
from tablegen.config.variants import Variant as Variant
from tablegen.api.many import BuildOutcome as BuildOutcome
from tablegen.api.result import (
    Result as Result,
    Picture as Picture,
)
from tablegen.api.calibrate import Calibrated as Calibrated
from tablegen.api.calibrated_operator import CalibratedOperator as CalibratedOperator
from tablegen.api.calibrated_records import CalibratedRecords as CalibratedRecords
from tablegen.api.calibrate_coupling import CalibratedCoupling as CalibratedCoupling
from tablegen.api.read_image import (
    Image as Image,
    Channels as Channels,
)
from tablegen.api.lattice import ImageLattice as ImageLattice
from tablegen.api.drift import ImageDrift as ImageDrift
from tablegen.api.refine import RefinedScan as RefinedScan
from tablegen.api.refine_turned import RefinedTurned as RefinedTurned
from tablegen.api.correct import Corrected as Corrected
from tablegen.api.simulate import SimulatedScan as SimulatedScan
from tablegen.api.simulate_turned import SimulatedTurned as SimulatedTurned
from tablegen.api.predict import Predicted as Predicted
from tablegen.api.compare import Compared as Compared
from tablegen.api.tables import FeasibleTables as FeasibleTables
from tablegen.api.report import ReportPage as ReportPage
from tablegen.sweeping.run import ScanLibrary as ScanLibrary
from tablegen.manifest.read import StoredBuild as StoredBuild
from tablegen.link.prepare import PreparedScan as PreparedScan
from tablegen.verification.build_report import Report as Report
from tablegen.emit.format import Format as Format
from tablegen.emit.content import Content as Content
from tablegen.base.input_errors import (
    Rejected as Rejected,
    Problem as Problem,
    Unphysical as Unphysical,
)
from tablegen.api.build import BrokenLimit as BrokenLimit
from tablegen.emit.write import CannotWrite as CannotWrite
from tablegen.manifest.read import NotABuild as NotABuild
from tablegen.verification.failures import ToolMissing as ToolMissing
from tablegen.link.errors import LinkError as LinkError
from tablegen.version import __version__ as __version__
