"""What runs on the emulated robot's processor: commands, tools, turrets, boot text. One line in, its answer out."""

from khepera_hil.rom.fitted import DEFAULT_FITTINGS, FITTINGS, turrets
from khepera_hil.rom.models import KHEPERA, MODELS, Model, model_for
from khepera_hil.rom.rom import Reply, Rom

__all__ = ["DEFAULT_FITTINGS", "FITTINGS", "KHEPERA", "MODELS", "Model", "Reply", "Rom", "model_for", "turrets"]
