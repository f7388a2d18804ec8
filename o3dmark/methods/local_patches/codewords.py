"""The key's code on the coefficients of a patch: which carry pilots, which carry bits, and how a patch is recognised.

Of the real coefficients, in units of the strength, some are pilots: they stand on codewords of 0. The others carry a
share of the bits (see `scs`). What a pilot shows is where it stands within a period; what a carrier shows of a mark
that nobody knows is where it stands within half a period. Under a wrong key both are uniform and independent, by the
dither, so that the agreement

    T = sum over pilots of cos(2 pi phase) + 1/2 sum over carriers of cos(4 pi phase)

has one distribution, whatever the surface, with the moment-generating function I0(l)^pilots I0(l / 2)^carriers; and
given T, each bit is a fair coin still.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from scipy import special

from o3dmark.arrays import Bits, Complexes, Floats, Ints
from o3dmark.coding.keys import Key
from o3dmark.coding.scs import ScalarCosta
from o3dmark.methods.local_patches.disk import DiskFunctions, disk_functions
from o3dmark.methods.local_patches.format import PatchFormat

_SLOPES = np.geomspace(0.03, 400.0, 800)  # l, among which a saddle point is chosen
_ALONG = np.linspace(0.0, 12.0, 151)  # of the integral along the line through it, in standard deviations
_TAIL = 400  # values of T for which it is worked out


@dataclass(frozen=True, eq=False)
class Share:
    """What patches of one kind carry: coefficient j of ``source`` (K,), pilots first; the bit (K - pilots,) of each
    carrier, and the dither (K,) in periods."""

    kind: int
    functions: DiskFunctions
    source: Ints
    bit: Ints
    dither: Floats

    @classmethod
    def all_of(cls, key: Key, form: PatchFormat, n_bits: int) -> "list[Share]":
        """The key's, of patches of each kind."""
        functions = disk_functions(form)
        found = []
        for kind, bit in enumerate(form.shares(n_bits)):
            stream = key.stream(f"{form.stream}/{kind}")
            source = stream.permutation(functions.n_real)
            found.append(cls(kind, functions, source, bit, stream.uniform(functions.n_real)))
        return found

    @property
    def pilots(self) -> int:
        return len(self.source) - len(self.bit)

    @cached_property
    def _order(self) -> tuple[Ints, Ints, Floats]:
        """Of each coefficient the disk function (K,), its order m (K,), and whether it is the imaginary part (K,)."""
        function, imaginary = _real_parts(self.functions)
        function, imaginary = function[self.source], imaginary[self.source]
        return function, self.functions.order[function], imaginary

    def waves(self, found: Complexes) -> tuple[Floats, Floats]:
        """Coefficients (p, K) of cos(m angle) and sin(m angle) in what a patch shows, seen from another angle."""
        function, _, imaginary = self._order
        each = found[:, function]
        return np.where(imaginary, each.imag, each.real), np.where(imaginary, each.real, -each.imag)

    def turns(self, angles: Floats) -> tuple[Floats, Floats]:
        """cos(m angle) and sin(m angle) of each coefficient: (a, K) both."""
        phase = np.outer(angles, self._order[1])
        return np.cos(phase), np.sin(phase)

    def values(self, found: Complexes, angle: Floats) -> Floats:
        """The real coefficients (p, K) of patches (p, q) seen from an angle (p,) each; one of either goes with all."""
        cosine, sine = self.waves(found)
        turn, turn_sine = self.turns(angle)
        return np.asarray(cosine * turn + sine * turn_sine)

    def restored(self, values: Floats, angle: Floats) -> Complexes:
        """What patches show (p, q) that have such values (p, K) seen from an angle (p,) each."""
        function, _, imaginary = self._order
        found = np.zeros((len(values), len(self.functions.order)), np.complex128)
        np.add.at(found.T, function, np.where(imaginary, 1j * values, values).T)
        return np.asarray(found * np.exp(-1j * np.multiply.outer(angle, self.functions.order)))

    def codewords(self, values: Floats, bits: Bits) -> Floats:
        """The codeword of the bits that is nearest to each of the values (..., K), in periods."""
        halves = np.concatenate([np.zeros(self.pilots), bits[self.bit]])
        return ScalarCosta(1.0).codeword(values, halves, self.dither)

    def soft(self, phase: Floats, n_bits: int) -> Floats:
        """Soft bits (n_bits,) from phases (K,): 0 where no carrier has the bit."""
        soft = -np.cos(2.0 * np.pi * phase[self.pilots :])
        return np.asarray(np.bincount(self.bit, soft, n_bits))

    def agreement(self, phase: Floats) -> Floats:
        """T (...) of phases (..., K)."""
        pilots, carriers = phase[..., : self.pilots], phase[..., self.pilots :]
        return np.asarray(np.cos(2.0 * np.pi * pilots).sum(axis=-1) + 0.5 * np.cos(4.0 * np.pi * carriers).sum(axis=-1))

    @property
    def most(self) -> float:
        """The highest T that there is."""
        return self.pilots + 0.5 * len(self.bit)

    def off(self, phase: Floats) -> tuple[Floats, Floats]:
        """How far phases (..., K) are from codewords of either bit, and the period (K,) of these."""
        return phase - self.period * np.rint(phase / self.period), self.period

    @cached_property
    def period(self) -> Floats:
        """How far apart codewords of either bit are (K,): a pilot has no bit but 0."""
        return np.where(np.arange(len(self.source)) < self.pilots, 1.0, 0.5)

    def log10_p(self, agreement: Floats) -> Floats:
        """log10 of the probability (...) that a wrong key agrees so well."""
        levels, log10_p = _tail(self.pilots, len(self.bit))
        return np.where(np.asarray(agreement) > 0.0, np.interp(agreement, levels, log10_p), 0.0)


@cache
def _tail(pilots: int, carriers: int) -> tuple[Floats, Floats]:
    """Values of T from 0 to the highest, and log10 P(T >= x), by the inverse Laplace transform.

    The integral of exp(K(l) - l x) / l over the line in the complex plane that stands on the saddle point, K being the
    logarithm of the moment-generating function (Daniels 1954).
    """
    levels = np.linspace(0.0, pilots + 0.5 * carriers, _TAIL + 1)[:-1]
    growth = _cumulant(_SLOPES, pilots, carriers).real
    log10_p = []
    for level in levels:
        saddle = _SLOPES[np.argmin(growth - _SLOPES * level)]
        width = 1.0 / np.sqrt(_spread(saddle, pilots, carriers))
        line = saddle + 1j * width * _ALONG
        bound = float((_cumulant(np.array([saddle]), pilots, carriers).real - saddle * level)[0])
        there = np.exp(_cumulant(line, pilots, carriers) - line * level - bound) / line
        log10_p.append((bound + np.log(np.trapezoid(there.real, dx=width * _ALONG[1]) / np.pi)) / np.log(10.0))
    return levels, np.minimum(np.array(log10_p), 0.0)


def _real_parts(functions: DiskFunctions) -> tuple[Ints, Floats]:
    """Of each real coefficient the disk function that it belongs to (K,), and whether it is its imaginary part (K,)."""
    both = [(q, part) for q, m in enumerate(functions.order.tolist()) for part in ((False, True) if m else (False,))]
    function, imaginary = zip(*both, strict=True)
    return np.array(function, np.int64), np.array(imaginary)


def _cumulant(slopes: Floats | Complexes, pilots: int, carriers: int) -> Complexes:
    """The logarithm of the moment-generating function of T at ``slopes`` (...)."""
    return np.asarray(pilots * _log_i0(slopes) + carriers * _log_i0(0.5 * slopes), np.complex128)


def _spread(slope: float, pilots: int, carriers: int) -> float:
    """Its second derivative at a real slope: the variance of T in the distribution tilted to it."""
    step = 1e-3 * slope
    low, middle, high = _cumulant(np.array([slope - step, slope, slope + step]), pilots, carriers).real
    return float((low - 2.0 * middle + high) / step**2)


def _log_i0(z: Floats | Complexes) -> Complexes:
    z = np.asarray(z, np.complex128)
    return np.asarray(np.log(special.ive(0, z)) + z.real)
