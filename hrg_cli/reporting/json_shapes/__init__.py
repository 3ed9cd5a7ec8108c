"""What every command prints with --json: one model a command. The documentation and its JSON
schemas are made from these models, and a test holds the commands' real outputs against them.

A figure that is not finite, or that a result does not have, is null. Keys of a table that are
names (of parameters, effects, columns) are free; every other key is listed, and no other is
printed.
"""

from __future__ import annotations

from .ahead import ForecastOfDrift, Mismatch, Plan
from .calibration import Calibrate, CalibrateTable, Compensate, Export, Update
from .catalogue import Effects, Study
from .chain import Lot, Run
from .diagnosis import Diagnose
from .files import CheckFiles, Diff, Info, Report, Verify
from .ledger import LedgerAdd, LedgerHistory, LedgerShow
from .recording import Import, Inject, Simulate
from .rehearsal import Rehearse
from .resonator import Identify, Rate
from .shape import Common
from .wave import Demodulate, Estimate

SHAPES: dict[str, tuple[type[Common], ...]] = {
    "import": (Import,),
    "simulate": (Simulate,),
    "inject": (Inject,),
    "demodulate": (Demodulate,),
    "estimate": (Estimate,),
    "identify": (Identify,),
    "rate": (Rate,),
    "calibrate": (Calibrate, CalibrateTable),
    "compensate": (Compensate,),
    "diagnose": (Diagnose,),
    "plan": (Plan,),
    "forecast": (ForecastOfDrift,),
    "mismatch": (Mismatch,),
    "update": (Update,),
    "export": (Export,),
    "check": (CheckFiles,),
    "diff": (Diff,),
    "report": (Report,),
    "info": (Info,),
    "verify": (Verify,),
    "rehearse": (Rehearse,),
    "run": (Run,),
    "batch": (Lot,),
    "ledger": (LedgerAdd, LedgerShow, LedgerHistory),
    "study": (Study,),
    "effects": (Effects,),
}
"""Command -> its JSON; of calibrate one of two, of ledger that of its subcommand."""
