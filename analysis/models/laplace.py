"""Laplace approximation of the cumulative-logit model with crossed random effects, with its exact gradient.

P(y <= k) = F(alpha_k - eta), eta = X beta + sum_c s_c z_c u_participant,c + sum_k t_k w_k v_item,k, with u
and v standard normal, F logistic, as in R's ordinal::clmm (Christensen 2019). The first columns z and w are
ones, the intercepts; the others are contrasts, whose slopes differ between participants or items.
F(a) - F(b) = F(a) F(-b) (1 - exp(b - a)), so that the log-likelihood of a rating has simple derivatives by
eta: F(a) + F(b) - 1, then -(f(a) + f(b)).
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import special

from experiments.errors import InputError

# Trials and parameters of the cumulative-logit mixed model.

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class OrdinalData:
    """Trials: x (n, f), category codes from 0 (n,), participant and item codes (n,).

    `z` (n, c) are the columns whose coefficients differ between participants, `term` (c,) the random term,
    from 0, that each belongs to: the columns of a term share one SD. `z_item` (n, k) and `term_item` (k,) are
    those of items, whose terms are counted from 0 too.
    """

    x: Floats = field(repr=False)
    z: Floats = field(repr=False)
    term: Integers = field(repr=False)
    category: Integers = field(repr=False)
    participant: Integers = field(repr=False)
    item: Integers = field(repr=False)
    n_categories: int
    n_participants: int
    n_items: int
    z_item: Floats = field(repr=False)
    term_item: Integers = field(repr=False)

    @property
    def n_terms(self) -> int:
        """Random terms of participants; their SDs precede those of items."""
        return int(self.term.max()) + 1

    @property
    def n_sds(self) -> int:
        """SDs of the participants' terms, then of the items'."""
        return self.n_terms + int(self.term_item.max()) + 1

    def scaled(self, sd: Floats) -> tuple[Floats, Floats]:
        """Columns times their SDs, of participants (n, c) and of items (n, k)."""
        return self.z * sd[self.term], self.z_item * sd[self.n_terms :][self.term_item]


@dataclass(frozen=True)
class Parameters:
    """Thresholds (categories - 1,), coefficients (f,), SDs of participants' terms and then of items'.

    A likelihood's gradient has this form too. It is even in every SD: at zero, its derivative is zero.
    """

    thresholds: Floats
    beta: Floats
    sd: Floats


def by_sd(by_log_sd: Floats, sd: Floats) -> Floats:
    """Derivatives by SDs from those by their logarithms; zero where the SD is, as the likelihood is even."""
    return np.divide(by_log_sd, sd, out=np.zeros(len(sd)), where=sd != 0)


# Hessian of the joint density of ratings and crossed random effects, by blocks.


class CrossedHessian:
    """H = I + L'WL of the crossed effects.

    Its blocks are A of participants and D of items (both block diagonal) and B between them. The larger
    of the two is eliminated, so that the one matrix inverted whole is the smaller one's Schur complement.
    """

    def __init__(self, data: OrdinalData, scaled: Floats, scaled_item: Floats, weight: Floats) -> None:
        n, c, j, k = data.n_participants, scaled.shape[1], data.n_items, scaled_item.shape[1]
        self.shape = (n, c, j, k)
        a = _own_blocks(data.participant, n, scaled, weight)
        d = _own_blocks(data.item, j, scaled_item, weight)
        # One number per pair of participant and item, so that a single pass sums the trials of each.
        pair = data.participant * j + data.item
        b = np.empty((n, c, j, k))
        for row in range(c):
            for column in range(k):
                w = weight * scaled[:, row] * scaled_item[:, column]
                b[:, row, :, column] = np.bincount(pair, weights=w, minlength=n * j).reshape(n, j)
        self.b = b.reshape(n * c, j * k)
        self.keeps_people = n * c <= j * k
        if self.keeps_people:
            self._eliminate_items(a, d)
        else:
            self._eliminate_people(a, d)

    def _eliminate_items(self, a: Floats, d: Floats) -> None:
        n, c, j, k = self.shape
        self.d_inverse = np.linalg.inv(d)
        by_item = self.b.reshape(n * c, j, k).transpose(1, 0, 2) @ self.d_inverse
        self.scaled_b: Floats = by_item.transpose(1, 0, 2).reshape(n * c, j * k)
        schur = _block_diagonal(a) - self.scaled_b @ self.b.T
        self.inverse = np.linalg.inv(schur)
        self.log_det = float(np.linalg.slogdet(schur)[1] + np.linalg.slogdet(d)[1].sum())

    def _eliminate_people(self, a: Floats, d: Floats) -> None:
        n, c, j, k = self.shape
        self.a_inverse = np.linalg.inv(a)
        self.scaled_b = (self.a_inverse @ self.b.reshape(n, c, j * k)).reshape(n * c, j * k)
        schur = _block_diagonal(d) - self.b.T @ self.scaled_b
        self.inverse = np.linalg.inv(schur)
        self.log_det = float(np.linalg.slogdet(schur)[1] + np.linalg.slogdet(a)[1].sum())

    def solve(self, r_p: Floats, r_i: Floats) -> tuple[Floats, Floats]:
        """H^-1 of vectors of participants (people, c) and items (items, k)."""
        if self.keeps_people:
            people = self.inverse @ (r_p.ravel() - self.scaled_b @ r_i.ravel())
            alone = np.einsum("jkl,jl->jk", self.d_inverse, r_i)
            return people.reshape(r_p.shape), alone - (self.scaled_b.T @ people).reshape(r_i.shape)
        items = self.inverse @ (r_i.ravel() - self.scaled_b.T @ r_p.ravel())
        alone = np.einsum("ncd,nd->nc", self.a_inverse, r_p)
        return alone - (self.scaled_b @ items).reshape(r_p.shape), items.reshape(r_i.shape)

    def blocks(self) -> tuple[Floats, Floats, Floats]:
        """Blocks of H^-1: participants' (people, c, c), items' (items, k, k), cross (people, c, items, k)."""
        n, c, j, k = self.shape
        if self.keeps_people:
            cross = -self.inverse @ self.scaled_b
            between = self.scaled_b.reshape(-1, j, k), cross.reshape(-1, j, k)
            items = self.d_inverse - np.einsum("qjk,qjl->jkl", *between)
            return _diagonal_blocks(self.inverse, n, c), items, cross.reshape(self.shape)
        cross = (-self.scaled_b @ self.inverse).reshape(n, c, j * k)
        people = self.a_inverse - np.einsum("ncj,ndj->ncd", cross, self.scaled_b.reshape(n, c, j * k))
        return people, _diagonal_blocks(self.inverse, j, k), cross.reshape(self.shape)


def _own_blocks(level: Integers, levels: int, scaled: Floats, weight: Floats) -> Floats:
    """The identity plus each level's sums of weighted products of columns, (levels, c, c)."""
    c = scaled.shape[1]
    blocks = np.empty((levels, c, c))
    for row in range(c):
        for column in range(row + 1):
            w = weight * scaled[:, row] * scaled[:, column]
            blocks[:, row, column] = blocks[:, column, row] = np.bincount(level, weights=w, minlength=levels)
    return blocks + np.eye(c)


def _block_diagonal(blocks: Floats) -> Floats:
    levels, c, _ = blocks.shape
    whole = np.zeros((levels, c, levels, c))
    whole[np.arange(levels), :, np.arange(levels)] = blocks
    return whole.reshape(levels * c, levels * c)


def _diagonal_blocks(whole: NDArray[np.floating], levels: int, c: int) -> Floats:
    each = np.arange(levels)
    return np.asarray(whole.reshape(levels, c, levels, c)[each, :, each], np.float64)


NEWTON_STEPS = 60
SCORE_TOLERANCE = 1e-9


class Trials:
    """Likelihood and derivatives of each trial's category, from thresholds and predictors eta (n,)."""

    def __init__(self, thresholds: Floats, category: Integers, eta: Floats) -> None:
        edges = np.concatenate([[-np.inf], thresholds, [np.inf]])
        a, b = edges[category + 1] - eta, edges[category] - eta
        self.upper, self.lower = special.expit(a), special.expit(b)
        # Not 1 - upper, which is 0 in double precision from a = 37 on.
        self.above = special.expit(-a)
        self.f_upper, self.f_lower = self.upper * self.above, self.lower * special.expit(-b)
        # exp(b - a) from the edges alone: eta cancels, and an open end gives 0.
        gap = np.exp(-(edges[category + 1] - edges[category]))
        self.log_chances = special.log_expit(a) + special.log_expit(-b) + np.log1p(-gap)
        self.log_likelihood = float(self.log_chances.sum())
        self.between = gap / (1 - gap)
        self.slope = self.lower - self.above
        self.weight = self.f_upper + self.f_lower

    @property
    def curve_upper(self) -> Floats:
        """Derivative of `f_upper` by the edge above, (n,)."""
        return np.asarray(self.f_upper * (self.above - self.upper))

    @property
    def curve_lower(self) -> Floats:
        """Derivative of `f_lower` by the edge below, (n,)."""
        return np.asarray(self.f_lower * (1 - 2 * self.lower))


@dataclass
class LaplaceLikelihood:
    """Log-likelihood of OrdinalData; keeps the last modes as the start for the next."""

    data: OrdinalData
    u: Floats = field(init=False, repr=False)
    v: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.u = np.zeros((self.data.n_participants, self.data.z.shape[1]))
        self.v = np.zeros((self.data.n_items, self.data.z_item.shape[1]))

    def predictor(self, p: Parameters, u: Floats, v: Floats) -> Floats:
        """Linear predictor of each trial (n,) where the random effects are u (people, c) and v (items, k)."""
        d = self.data
        scaled, scaled_item = d.scaled(p.sd)
        of_people = np.einsum("tc,tc->t", scaled, u[d.participant])
        of_items = np.einsum("tk,tk->t", scaled_item, v[d.item])
        return np.asarray(d.x @ p.beta + of_people + of_items, dtype=np.float64)

    def _trials(self, p: Parameters, u: Floats, v: Floats) -> Trials:
        """Trials where the random effects are u (people, c) and v (items, k)."""
        return Trials(p.thresholds, self.data.category, self.predictor(p, u, v))

    def _carried(self, scaled: Floats, scaled_item: Floats, values: Floats) -> tuple[Floats, Floats]:
        """L' of values of trials (n,): to participants (people, c) and items (items, k)."""
        d = self.data
        of_people = [np.bincount(d.participant, values * z, d.n_participants) for z in scaled.T]
        of_items = [np.bincount(d.item, values * z, d.n_items) for z in scaled_item.T]
        return np.stack(of_people, axis=1), np.stack(of_items, axis=1)

    def _modes(self, p: Parameters) -> tuple[Trials, CrossedHessian]:
        """Newton with halved steps: the joint density is log-concave, so it always arrives."""
        scaled = self.data.scaled(p.sd)
        u, v = self.u, self.v
        t = self._trials(p, u, v)
        value = t.log_likelihood - ((u**2).sum() + (v**2).sum()) / 2
        for _ in range(NEWTON_STEPS):
            hessian = CrossedHessian(self.data, *scaled, t.weight)
            of_people, of_items = self._carried(*scaled, t.slope)
            score = of_people - u, of_items - v
            if (
                max(np.abs(score[0]).max(), np.abs(score[1]).max())
                < SCORE_TOLERANCE * (1 + abs(value)) ** 0.5
            ):
                self.u, self.v = u, v
                return t, hessian
            u, v, t, value = self._step(p, (u, v), hessian.solve(*score), value)
        raise InputError(
            "the random effects of the ordinal model did not converge; ratings may be separated or too few"
        )

    def _step(
        self, p: Parameters, at: tuple[Floats, Floats], step: tuple[Floats, Floats], value: float
    ) -> tuple[Floats, Floats, Trials, float]:
        """A Newton step, halved until the joint density does not fall."""
        length = 1.0
        while True:
            u, v = at[0] + length * step[0], at[1] + length * step[1]
            trial = self._trials(p, u, v)
            reached = trial.log_likelihood - ((u**2).sum() + (v**2).sum()) / 2
            # Near the mode the density changes by less than its rounding: steps must not be halved for that.
            if reached >= value - 1e-9 * abs(value) or length < 1e-6:
                return u, v, trial, reached
            length /= 2

    def intercepts(self, p: Parameters) -> tuple[Floats, Floats, Trials]:
        """Modes of participants' first coefficient (people,), roots of its entries in H^-1, trials there."""
        trials, hessian = self._modes(p)
        return self.u[:, 0], np.sqrt(hessian.blocks()[0][:, 0, 0]), trials

    def spreads(self, p: Parameters) -> Floats:
        """Participants' blocks (people, c, c) of H^-1 at the modes, which are kept."""
        _, hessian = self._modes(p)
        return hessian.blocks()[0]

    def evaluate(self, p: Parameters) -> tuple[float, Parameters]:
        r"""Laplace log-likelihood, and its gradient in the form of Parameters.

        Notes
        -----
        l is the ratings' log-likelihood at the modes b = (u, v), Z their columns times the SDs, W minus the
        second derivatives of l by eta, and H = Z'WZ + I:

        .. math::

            \mathcal L &= l(\eta) - b'b / 2 - \log|H| / 2 \tag{1} \\
            q_t &= z_t' H^{-1} z_t, \quad
            c_t = \partial \log|H| / \partial \eta_t = q_t \, dW_t / d\eta_t \tag{2} \\
            \partial \mathcal L / \partial \beta &= X' \{l'(\eta) - (c - W Z H^{-1} Z' c) / 2\} \tag{3}

        In (3) the modes move with eta, by -H^-1 Z'W; q is `spread`, c `change`, ZH^-1 Z'c `pull`. Thresholds
        and SDs follow by the same chain.
        """
        d = self.data
        scaled, scaled_item = d.scaled(p.sd)
        t, hessian = self._modes(p)
        u, v = self.u, self.v
        value = t.log_likelihood - ((u**2).sum() + (v**2).sum()) / 2 - hessian.log_det / 2
        of_people, of_items, cross = hessian.blocks()
        # spread: each trial's z' H^-1 z; pull: what a moved mode does to log|H|, carried back to eta
        spread = (
            np.einsum("tc,tcd,td->t", scaled, of_people[d.participant], scaled)
            + np.einsum("tk,tkl,tl->t", scaled_item, of_items[d.item], scaled_item)
            + 2 * np.einsum("tc,tck,tk->t", scaled, cross[d.participant, :, d.item], scaled_item)
        )
        change = -spread * (t.curve_upper + t.curve_lower)
        v_p, v_i = hessian.solve(*self._carried(scaled, scaled_item, change))
        pull = np.einsum("tc,tc->t", scaled, v_p[d.participant])
        pull += np.einsum("tk,tk->t", scaled_item, v_i[d.item])
        beta = d.x.T @ (t.slope - (change - pull * t.weight) / 2)
        upper = t.above + t.between - (spread * t.curve_upper + pull * t.f_upper) / 2
        lower = -t.lower - t.between - (spread * t.curve_lower + pull * t.f_lower) / 2
        edges = np.bincount(d.category + 1, weights=upper, minlength=d.n_categories + 1)
        edges += np.bincount(d.category, weights=lower, minlength=d.n_categories + 1)
        by_log_sd = np.concatenate(
            [_by_log_sd(u, of_people, v_p, d.term), _by_log_sd(v, of_items, v_i, d.term_item)]
        )
        return float(value), Parameters(edges[1:-1].astype(np.float64), beta, by_sd(by_log_sd, p.sd))


def _by_log_sd(modes: Floats, inverse: Floats, moved: Floats, term: Integers) -> Floats:
    """Derivatives by the log SDs of one grouping's terms: modes, their part of H^-1, and its pull."""
    of_columns = (modes**2 - (1 - np.einsum("ncc->nc", inverse)) - moved * modes).sum(axis=0)
    return np.asarray(np.bincount(term, weights=of_columns), np.float64)
