"""What can be fitted: a structure with its order, and one call that fits it, whatever it is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hydraulic_sysid.linear.errors import IdentificationError

from .arx import ArxOrder, fit_arx
from .instrumental_variables import fit_arx_instruments
from .model import LinearModel
from .subspace import fit_state_space
from .transfer_function import TransferFunctionOrder
from .transfer_function_fit import fit_transfer_function

Arrays = Sequence[ArrayLike]


class Structure(ABC):
    """A model structure of a certain order."""

    @property
    @abstractmethod
    def text(self) -> str:
        """Its name for people, ``ARX(3, 3, 1)``."""

    @property
    def memory(self) -> int:
        """Samples at the beginning of each experiment that the fit has no error for."""
        return 0

    @abstractmethod
    def fit(self, drives: Arrays, outputs: Arrays, dt: float, offsets: str) -> LinearModel:
        """The model of these experiments.

        :raises IdentificationError: they do not give one.
        """

    @abstractmethod
    def document(self) -> dict[str, Any]:
        """Kind and orders, for result documents and model files."""

    @abstractmethod
    def up_to(self) -> list[Structure]:
        """All structures of the kind up to this order, the simplest first."""


@dataclass(frozen=True)
class Arx(Structure):
    """ARX, by least squares or, with ``instruments``, by instrumental variables."""

    order: ArxOrder = ArxOrder(3, 3, 1)
    instruments: bool = False

    @property
    def text(self) -> str:
        return self.order.text + (" by instrumental variables" if self.instruments else "")

    @property
    def memory(self) -> int:
        return self.order.memory

    def fit(self, drives: Arrays, outputs: Arrays, dt: float, offsets: str) -> LinearModel:
        return (fit_arx_instruments if self.instruments else fit_arx)(drives, outputs, dt, self.order, offsets)

    def document(self) -> dict[str, Any]:
        method = "instrumental variables" if self.instruments else "least squares"
        return {"structure": "arx", "method": method, **vars(self.order)}

    def up_to(self) -> list[Structure]:
        # the dead time from 1 (or 0, where that is asked for) on
        o = self.order
        ranges = range(1, o.na + 1), range(1, o.nb + 1), range(min(1, o.nk), o.nk + 1)
        orders = sorted(product(*ranges), key=lambda x: (x[0] + x[1], x[0], x[2]))
        return [replace(self, order=ArxOrder(*order)) for order in orders]


@dataclass(frozen=True)
class TransferFunction(Structure):
    """Continuous-time transfer function with a known dead time [s], by output error or SRIVC."""

    order: TransferFunctionOrder = TransferFunctionOrder()
    delay: float = 0.0
    method: str = "output error"

    @property
    def text(self) -> str:
        return self.order.text + (f", dead time {self.delay * 1e3:g} ms" if self.delay else "")

    def fit(self, drives: Arrays, outputs: Arrays, dt: float, offsets: str) -> LinearModel:
        return fit_transfer_function(
            drives, outputs, dt, self.order, delay=self.delay, offsets=offsets, method=self.method
        )

    def document(self) -> dict[str, Any]:
        return {"structure": "transfer function", "method": self.method, **vars(self.order), "delay": self.delay}

    def up_to(self) -> list[Structure]:
        # an integrator stays
        return [
            replace(self, order=replace(self.order, poles=poles, zeros=zeros))
            for poles in range(1, self.order.poles + 1)
            for zeros in range(min(self.order.zeros, poles - 1) + 1)
        ]


@dataclass(frozen=True)
class StateSpace(Structure):
    """Sampled state space by a subspace method; ``direct``: the input acts without delay."""

    states: int = 3
    direct: bool = False
    horizon: int | None = None

    @property
    def text(self) -> str:
        return f"state space with {self.states} state{'s' if self.states > 1 else ''}"

    def fit(self, drives: Arrays, outputs: Arrays, dt: float, offsets: str) -> LinearModel:
        return fit_state_space(
            drives, outputs, dt, self.states, horizon=self.horizon, direct=self.direct, offsets=offsets
        )

    def document(self) -> dict[str, Any]:
        return {"structure": "state space", "method": "subspace", "states": self.states, "direct": self.direct}

    def up_to(self) -> list[Structure]:
        return [replace(self, states=n) for n in range(1, self.states + 1)]


def fit_on_equal_samples(
    structure: Structure, drives: Arrays, outputs: Arrays, dt: float, offsets: str, memory: int
) -> LinearModel:
    """The model fitted to the errors of the samples from ``memory`` on, so that losses of orders can be compared.

    :raises IdentificationError: an experiment is shorter than that, or as `Structure.fit`.
    """
    skip = memory - structure.memory
    if skip < 0 or any(np.size(u) <= skip for u in drives):
        raise IdentificationError(f"{structure.text}: the experiments must be longer than {memory} samples")
    return structure.fit(
        [u[skip:] for u in map(np.asarray, drives)], [y[skip:] for y in map(np.asarray, outputs)], dt, offsets
    )
