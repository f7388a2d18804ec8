"""Who took part in a mixture of copies: which known vectors is another one made of, and how surely?

A copy is a vector: its codeword decides it, so to who lacks the key a copy's vector points anywhere, independently of
all others. The null hypothesis about a candidate is that his is independent of the mixture and of all other vectors;
then, whatever of the mixture the *others* leave unexplained, the cosine between that and his own is that of a random
direction, whose tail is known exactly:

    P(cosine >= t) in d dimensions = 1/2 I(1 - t^2; (d - 1) / 2, 1/2)

Who mixes by choosing, vertex by vertex, the least or any of the copies' coordinates leaves coordinates that are exactly
a copy's; how many an innocent copy would have by chance, vectors of random directions tell.

That directions are uniform is measured, not proved: see `tests/test_collusion.py` and docs/copies.md. How many of the
others explain how much is tried in a few ways, each of which is charged; so are all candidates.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy

from o3dmark.arrays import Floats

ATOMS = (0, 1, 2, 4, 9)  # others that explain a mixture at most, tried in turn: for ten colluders nine are enough
# With weights of one sign, as in a mean, or of both, as in A + B - C; and twice by weighing all others at once, which
# finds ten of a mean where one after the other goes astray (one of 14 means of ten, bunny)
VARIANTS = 2 * len(ATOMS) + 2
_MOMENT = 8  # of the counts of matches: fixed beforehand; higher ones are told less well by a few thousand counts
_SAFETY = 10.0  # for what so many counts may miss of the moment
_NOTHING = 1e-6  # of the mixture: what is left is rounding, and points where that points
_CROWD = 1000  # others that may explain a mixture: those that point most where it does, or away from there
_TRIED = 24  # candidates that fit best at all, whose p-value is worked out; the others get 0


class Seen(NamedTuple):
    """A mixture as far as a patch of it tells: its vector (d,), and those of the copies (N, d)."""

    mixture: Floats
    copies: Floats


class Matches(NamedTuple):
    """How many coordinates of a mixture are those of each copy (N,), and of vectors of random directions (D,)."""

    copies: Floats
    chance: Floats


@dataclass(frozen=True, eq=False)
class Mixture:
    """What is seen of a suspect beside the cover: patch by patch, and coordinate by coordinate, if that can be."""

    patches: tuple[Seen, ...] = ()
    matches: Matches | None = None

    def log10_p(self, n_copies: int) -> Floats:
        """For each copy (N,): log10 of the p-value that it took part; all candidates, patches and variants charged."""
        tests = [_of_vectors(each.mixture, each.copies) for each in self.patches]
        tests += [_of_matches(self.matches)] if self.matches is not None else []
        if not tests:
            return np.zeros(n_copies)
        return np.minimum(np.min(tests, axis=0) + math.log10(len(tests) * n_copies), 0.0)


def _of_matches(matches: Matches) -> Floats:
    """Markov's bound on a high moment: P(T >= t) <= E[T^m] / t^m, the moment that of the chance counts, and tenfold."""
    moment = float(np.mean(np.maximum(matches.chance, 1.0) ** _MOMENT))
    bound = math.log10(_SAFETY * moment) - _MOMENT * np.log10(np.maximum(matches.copies, 1.0))
    return np.minimum(bound, 0.0)


def _of_vectors(target: Floats, vectors: Floats) -> Floats:
    """For each of N vectors (N, d): log10 of the p-value that it is part of ``target`` (d,), the variants charged."""
    result = np.zeros(len(vectors))
    lengths = np.linalg.norm(vectors, axis=1)
    if not np.linalg.norm(target) > 0.0 or vectors.shape[1] < 2 or not lengths.all():
        return result
    unit = vectors / lengths[:, None]
    nearest = np.argsort(-np.abs(unit @ target), kind="stable")[: _CROWD + 1]
    for index in nearest[_promising(target, unit[nearest])].tolist():
        others = unit[nearest[nearest != index][:_CROWD]]
        least = min(_log10_tail(*cosine, len(target)) for cosine in _cosines(target, unit[index], others))
        result[index] = min(0.0, least + math.log10(VARIANTS))
    return result


def _promising(target: Floats, unit: Floats) -> Floats:
    """The candidates (c,) that some way of explaining the target takes, and those that point where it does."""
    found: dict[int, None] = {}
    for signed in (False, True):
        for chosen, _ in _explanations(target, unit, signed=signed, most=ATOMS[-1] + 1):
            found |= dict.fromkeys(chosen)
    weights = scipy.optimize.nnls(unit.T, target)[0]
    found |= dict.fromkeys(np.argsort(-weights)[: ATOMS[-1] + 1].tolist())
    found |= dict.fromkeys(np.argsort(-np.abs(unit @ target)).tolist())
    return np.array(list(found)[:_TRIED])


def _cosines(target: Floats, mine: Floats, others: Floats) -> Iterator[tuple[float, bool]]:
    """(cosine, whether either sign counts) of a vector with what others leave of the target."""
    nothing = _NOTHING * float(np.linalg.norm(target))
    for rest, signed in _rests(target, others):
        length = float(np.linalg.norm(rest))
        yield float(rest @ mine) / length if length > nothing else 0.0, signed


def _rests(target: Floats, others: Floats) -> Iterator[tuple[Floats, bool]]:
    """(what is left, whether the weights have both signs) in each of the ways of explaining a target: VARIANTS."""
    for signed in (False, True):
        rests = {0: target} | {len(chosen): rest for chosen, rest in _explanations(target, others, signed=signed)}
        for atoms in ATOMS:
            yield rests[min(atoms, max(rests))], signed
    weights = scipy.optimize.nnls(others.T, target)[0]
    yield target - weights @ others, False
    most = np.argsort(-weights)[: ATOMS[-1]]
    yield target - scipy.optimize.nnls(others[most].T, target)[0] @ others[most], False


def _explanations(
    target: Floats, unit: Floats, *, signed: bool, most: int = ATOMS[-1]
) -> Iterator[tuple[list[int], Floats]]:
    """(chosen, what is left) with one vector more each time, the one that points most where the rest does.

    Orthogonal matching pursuit, with weights above zero unless ``signed``.
    """
    chosen: list[int] = []
    rest = target
    for _ in range(min(most, len(unit))):
        score = unit @ rest
        score = np.abs(score) if signed else score
        score[chosen] = -np.inf
        chosen.append(int(np.argmax(score)))
        A = unit[chosen].T
        weights = np.linalg.lstsq(A, target, rcond=None)[0] if signed else scipy.optimize.nnls(A, target)[0]
        rest = target - A @ weights
        yield list(chosen), rest


def _log10_tail(cosine: float, either_sign: bool, dimensions: int) -> float:
    """log10 of the probability that a random direction has so large a cosine with a given one."""
    t = abs(cosine) if either_sign else max(cosine, 0.0)
    if t >= 1.0:
        return -math.inf
    half = 0.5 * float(scipy.special.betainc((dimensions - 1) / 2.0, 0.5, 1.0 - t * t))
    return math.log10(min(1.0, half * (2.0 if either_sign else 1.0))) if half > 0.0 else -300.0
