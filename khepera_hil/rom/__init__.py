"""What runs on the emulated robot's processor: commands, tools, turrets, boot text. One line in, its answer out."""

from khepera_hil.rom.fitted import FITTINGS
from khepera_hil.rom.models import KHEPERA, MODELS, Model, model_for
from khepera_hil.rom.rom import Reply, Rom

__all__ = ["FITTINGS", "KHEPERA", "MODELS", "Model", "Reply", "Rom", "model_for"]
