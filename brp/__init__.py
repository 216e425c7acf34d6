"""Bayesian Robot Programming (Lebeltel, Bessiere, Diard, Mazer 2004) as a library: probability, and no robot.

Dir = Variable("Dir", range(-10, 11))
Prox = Variable("Prox", range(16))
Vrot = Variable("Vrot", range(-10, 11))
obstacle = Specification(
    {
        P(Dir): Uniform(),
        P(Prox): Uniform(),
        P(Vrot | Dir, Prox): Gaussian(),
    },
    name="pi-obstacle",
)
push = obstacle.identify(samples, name="delta-push")
turn = push.ask(P(Vrot | Dir, Prox))
vrot = turn(Dir=3, Prox=12).draw(rng)
"""

from brp.counts import Histogram, Laplace
from brp.description import Description, Specification
from brp.distribution import Distribution
from brp.em import Identified, identify_hidden
from brp.errors import (
    BrpError,
    DataError,
    EvidenceError,
    ImpossibleEvidence,
    NotAValue,
    NotNumeric,
    QuestionError,
    SpecificationError,
    StoreError,
    TermError,
    TooLarge,
    Unidentified,
)
from brp.filter import Filter, Particles
from brp.forms import Dirac, Form, Sigmoid, Switch, Table, Uniform
from brp.gaussian import Gaussian, Prior
from brp.mrbt import Tree, tree
from brp.nearest import Nearest
from brp.propositions import Proposition
from brp.question import Question
from brp.sampling import Estimate, Sampling
from brp.store import load, load_data, save, save_data
from brp.variables import P, Term, Value, Variable

__all__ = [
    "BrpError",
    "DataError",
    "Description",
    "Dirac",
    "Distribution",
    "Estimate",
    "EvidenceError",
    "Filter",
    "Form",
    "Gaussian",
    "Histogram",
    "Identified",
    "ImpossibleEvidence",
    "Laplace",
    "Nearest",
    "NotAValue",
    "NotNumeric",
    "P",
    "Particles",
    "Prior",
    "Proposition",
    "Question",
    "QuestionError",
    "Sampling",
    "Sigmoid",
    "Specification",
    "SpecificationError",
    "StoreError",
    "Switch",
    "Table",
    "Term",
    "TermError",
    "TooLarge",
    "Tree",
    "Unidentified",
    "Uniform",
    "Value",
    "Variable",
    "identify_hidden",
    "load",
    "load_data",
    "save",
    "save_data",
    "tree",
]
