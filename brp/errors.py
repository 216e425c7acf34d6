"""Everything that the engine refuses, as one short tree.

    BrpError
    |-- TermError            P(...) that is no term: nothing left of the bar, a variable twice, two bars
    |-- SpecificationError   terms that are no decomposition, or a form that does not fit its term
    |-- DataError            samples that do not fit the variables
    |-- Unidentified         a free form that no data has identified
    |-- QuestionError        a question that the description cannot be asked
    |   `-- TooLarge         its largest array would pass the limit; nothing has been allocated
    |-- EvidenceError        a known variable is missing, superfluous, or
    |   `-- NotAValue        has a value that the variable does not have
    |-- ImpossibleEvidence   what is known has probability zero; names the terms that say so
    |-- StoreError           a file that is damaged, or made with another specification
    `-- NotNumeric           arithmetic on a variable whose values are words

Each carries one sentence that names the culprit and says what to do.
"""

from __future__ import annotations

__all__ = [
    "BrpError",
    "DataError",
    "EvidenceError",
    "ImpossibleEvidence",
    "NotAValue",
    "NotNumeric",
    "QuestionError",
    "SpecificationError",
    "StoreError",
    "TermError",
    "TooLarge",
    "Unidentified",
]


class BrpError(Exception):
    """The root; its text is a sentence that names the culprit and says what to do."""


class TermError(BrpError):
    """What stands between the brackets of ``P(...)`` is no term."""


class SpecificationError(BrpError):
    """The terms are no decomposition of a joint distribution, or a form does not fit its term."""


class DataError(BrpError):
    """The samples do not fit the variables that they are to identify."""


class Unidentified(BrpError):
    """A form with free parameters was asked before any data identified them."""


class QuestionError(BrpError):
    """The description cannot be asked this question."""


class TooLarge(QuestionError):
    """The largest array that the question needs would pass the limit; nothing has been allocated."""


class EvidenceError(BrpError):
    """What is said to be known is not what the question asks for."""


class NotAValue(EvidenceError):
    """A value that the variable does not have."""


class ImpossibleEvidence(BrpError):
    """What is known has probability zero under the description.

    ``terms`` holds the names of the terms that together exclude it; none of them can be left out.
    """

    def __init__(self, sentence: str, terms: tuple[str, ...] = ()) -> None:
        super().__init__(sentence)
        self.terms = terms


class StoreError(BrpError):
    """A file that is damaged, of another version, or made with another specification."""


class NotNumeric(BrpError):
    """Arithmetic was asked of a variable whose values are words."""
