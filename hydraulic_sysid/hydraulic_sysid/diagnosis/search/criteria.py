"""The constants of the search: all that decides which fits are made, which effect is named and what is said.

Each has its unit and its reason, and what becomes of benches where it is half or twice as large (of a share above a
half: what it lacks to 1; of a residual: what it has beyond). Of 13 benches of the family, which nothing was chosen on
(seed 111001, quick diagnoses), on so many something would be decided otherwise on the way; the six quickest of these
were diagnosed again, and so many verdicts are others. Of how much is done two benches show it. Of three benches with
two effects (seed 113001) only what is said of them changes anything. Counts of 9 are of seed 120001.
`benchmarks/criteria.py` measures that, and as much on others.

What only a method needs (grids, steps, orders of filters) stands with it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Any


def _constant(value: float, unit: str, reason: str, half: str, double: str, effort: bool = False) -> Any:
    said = {"unit": unit, "reason": reason, "half": half, "double": double}
    return field(default=value, metadata={**said, "effort": effort})


_effort = partial(_constant, effort=True)  # what says how much is done before something is decided


@dataclass(frozen=True)
class Criteria:
    """Constants by name; ``metadata`` of a field: its ``unit`` and ``reason``, what ``half`` and ``double`` change."""

    # When a fall of the misfit is one, and when nothing is left

    significant: float = _constant(
        25.0, "σ²", "fall of the sum of squares on segments for fitting that counts: five standard deviations",
        "12 of 13, no verdict", "9 of 13, no verdict",
    )  # fmt: skip
    confirmed: float = _constant(
        10.0, "σ²", "fall that segments for validation must show; there nothing was chosen from many",
        "2 of 13, no verdict", "2 of 13, no verdict",
    )  # fmt: skip
    visible: float = _constant(
        5e-4, "share of all values, in σ²", "a smaller fall is a matter of a law's details",
        "nothing", "7 of 13, no verdict",
    )  # fmt: skip
    agreed: float = _constant(
        50.0, "variance ratio",
        "squared size over its scatter between segments: chance and wrong noise gave 44 and less, effects 80 and more",
        "3 of 13, no verdict", "2 of 13, no verdict",
    )  # fmt: skip
    few: float = _constant(
        0.02, "share of segments",
        "so many, at least one, turn no verdict, neither by what they leave nor by their gain",
        "nothing", "4 of 13, no verdict",
    )  # fmt: skip
    noise_missed: float = _constant(
        0.015, "mean square over noise",
        "what an estimate of the noise may miss; with it left, an unknown law is twice as probable",
        "3 of 13, no verdict", "nothing",
    )  # fmt: skip
    little: float = _constant(
        1.03, "σ", "up to this residual nothing need be missing",
        "2 of 13, no verdict", "2 of 13, no verdict",
    )  # fmt: skip
    small: float = _constant(
        1.2, "mean square over noise", "not far off the noise",
        "4 of 13, no verdict", "2 of 13, no verdict",
    )  # fmt: skip
    small_unexplained: float = _constant(
        0.4, "share of what was left", "that effects may leave where little was left before",
        "1 of 13, no verdict", "1 of 13, no verdict",
    )  # fmt: skip
    nothing_left: float = _constant(
        0.006, "mean square over noise", "below this, beyond the noise, nothing is left",
        "2 of 13, no verdict", "3 of 13, no verdict",
    )  # fmt: skip
    seen: float = _constant(
        0.0025, "share of the residual",
        "by which it must fall where nothing seemed to be left: noise gave 0.09 %, effects 0.35 %",
        "nothing", "1 of 13, no verdict",
    )  # fmt: skip
    more_than_noise: float = _constant(
        2.0, "mean square over noise", "as much as the noise again is left: the shape of a law",
        "nothing", "nothing",
    )  # fmt: skip
    far_off: float = _constant(
        4.0, "mean square over noise", "so far off a model is bent, and a fit need not be finished",
        "3 of 13, no verdict; one of 3 pairs, rightly",
        "3 of 13, no verdict; two of 3 pairs (an area more, or the other one)",
    )  # fmt: skip

    # What an effect must explain, beside which others

    further: float = _constant(
        0.25, "share of what is left", "that a further effect must explain, unless it explains something of all",
        "6 of 13, no verdict", "7 of 13, no verdict",
    )  # fmt: skip
    needed: float = _constant(
        0.02, "share of what was explained", "that an effect must explain beside the others to stay",
        "nothing", "nothing",
    )  # fmt: skip
    subordinate: float = _constant(
        0.1, "share of what was explained", "a further effect below it must be told apart to be named",
        "nothing", "nothing",
    )  # fmt: skip
    law: float = _constant(
        0.05, "share of what it explains",
        "what laws are right to: others of its subsystem may explain its square, and a better model leave less by it",
        "5 of 13, no verdict", "3 of 13, no verdict",
    )  # fmt: skip
    law_elsewhere: float = _constant(
        0.0005, "share of what was explained", "that effects of other subsystems may explain, as laws are no better",
        "nothing", "nothing",
    )  # fmt: skip
    promises: float = _constant(
        3.0, "times the least fall", "what takes something off that nothing asked for must gain",
        "2 of 13, no verdict", "nothing",
    )  # fmt: skip
    nearly: float = _constant(
        0.9, "share, or collinearity", "from which one thing does nearly what another does",
        "nothing", "1 of 13, no verdict",
    )  # fmt: skip
    hopeless: float = _constant(
        0.6, "share of what is beyond the noise", "where less is explained, exchanging effects will not do either",
        "2 of 13, no verdict", "nothing",
    )  # fmt: skip
    most_of: float = _constant(
        0.5, "share", "from which something is the most of a whole: of what an effect takes off, of what is left",
        "nothing", "nothing",
    )  # fmt: skip
    far: float = _constant(
        5.0, "times what the best leaves", "what leaves more than so many times as much comes not near it",
        "1 of 13, no verdict", "nothing",
    )  # fmt: skip
    stops_short: float = _constant(
        2.0, "times",
        "how far a quick refit in an effect's place may lie above, of how far the effect's own stops short of its fit",
        "nothing", "nothing",
    )  # fmt: skip

    # Which candidates are fitted, and to what

    promising: float = _constant(
        0.04, "share of the best prediction", "from which a candidate is refitted",
        "13 of 13, no verdict", "12 of 13, no verdict",
    )  # fmt: skip
    near: float = _constant(
        0.93, "share of the best fall", "from which a refit is finished",
        "4 of 13, no verdict", "2 of 13, no verdict",
    )  # fmt: skip
    promised: float = _constant(
        0.5, "share of what must be explained", "that a quick refit must show to be fitted to the end",
        "9 of 13, no verdict", "8 of 13, no verdict",
    )  # fmt: skip
    other_change: float = _constant(
        0.5, "collinearity", "below which an effect and a rival cannot leave as little as each other by what they do",
        "nothing", "nothing",
    )  # fmt: skip
    worse_look: float = _constant(
        0.2, "share", "by which a look at few segments leaves them more: the fit leads to something worse",
        "nothing", "nothing",
    )  # fmt: skip
    same_look: float = _constant(
        0.02, "share of what is beyond the noise", "by which a look must fall: else the fit leads nowhere else",
        "6 of 13, no verdict", "7 of 13, no verdict",
    )  # fmt: skip
    perhaps: float = _constant(
        0.2, "times the least fall", "that a prediction must promise, as it often falls far short of a fit",
        "5 of 13, no verdict", "6 of 13, no verdict",
    )  # fmt: skip
    lopsided: float = _constant(
        4.0, "times", "what the values of one role leave beyond the noise, from which the other has seen little of it",
        "nothing", "2 of 13, no verdict",
    )  # fmt: skip
    lopsided_beyond: float = _constant(
        0.1, "mean square over noise", "beyond the noise there, or in test data beyond validation data: no chance",
        "nothing", "1 of 13, no verdict",
    )  # fmt: skip
    much_in_a_segment: float = _constant(
        2.0, "times the median mean square", "what a segment leaves that shows what is missing",
        "2 of 13, no verdict", "nothing",
    )  # fmt: skip

    # Which of two models, and how probable it is

    odds: float = _constant(
        20.0, "odds", "from which two models are told apart: 95 %",
        "1 of 13, no verdict", "nothing",
    )  # fmt: skip
    distinct: float = _constant(
        30.0, "σ²", "the difference of the sums of squares that gives these odds",
        "2 of 13, no verdict", "2 of 13, no verdict",
    )  # fmt: skip
    most_power: float = _constant(
        3.0, "power of the odds", "up to which odds are counted: a fit may have stopped short",
        "4 of 13, no verdict", "4 of 13, no verdict",
    )  # fmt: skip
    unknown_laws: float = _constant(
        1e-3, "share of the mean square explained",
        "that laws leave without a law that the library lacks being more probable",
        "nothing", "nothing",
    )  # fmt: skip

    # Numbers of the data sheet

    rough: float = _constant(
        0.02, "share of what is explained", "what a prediction or a quick refit that goes far may be off",
        "nothing", "2 of 13, no verdict",
    )  # fmt: skip
    number_visible: float = _constant(
        0.01, "share of all values, in σ²", "fall for which a number of the data sheet is named",
        "3 of 13, one verdict names the supply pressure, too; one of 3 pairs (an area more)", "4 of 13, no verdict",
    )  # fmt: skip
    plausible: float = _constant(
        3.0, "times the default", "standard deviation of the size of an effect that is a share",
        "11 of 13, no verdict", "11 of 13, no verdict",
    )  # fmt: skip
    clear: float = _constant(
        10.0, "times what names a number", "beyond which a fit need not show what keeping it costs",
        "nothing", "nothing",
    )  # fmt: skip
    guessed: float = _constant(
        4.0, "numbers", "where more are others the sheet is a guess, and none can be told from the rest",
        "1 of 13, no verdict", "nothing",
    )  # fmt: skip

    # The recording, its noise and its changes

    filtered: float = _constant(
        0.95, "sampling intervals, or per cent", "by less a sound transducer with its filter is late, too",
        "nothing", "nothing",
    )  # fmt: skip
    conversion_order: float = _constant(
        0.6, "sampling intervals", "by less another order of conversion makes early",
        "nothing", "1 of 13, no verdict",
    )  # fmt: skip
    same_delay: float = _constant(
        0.03, "sampling intervals", "by which two delays are one",
        "6 of 13, no verdict", "5 of 13, no verdict",
    )  # fmt: skip
    unnoticed: float = _constant(
        0.003, "share of the motion", "what leaves less is no disturbance of the drive",
        "1 of 13, no verdict", "2 of 13, no verdict",
    )  # fmt: skip
    same_size: float = _constant(
        0.005, "share of a fault's size",
        "until it changes by no more it is sought again: what is left of a gain is an offset",
        "nothing", "1 of 13, no verdict",
    )  # fmt: skip
    glimpsed: float = _constant(
        0.25, "share of what must be explained",
        "that a fault of a reading must promise before the model is fitted with it",
        "1 of 13, no verdict", "1 of 13, no verdict",
    )  # fmt: skip
    quieter: float = _constant(
        0.95, "of the noise before", "what was judged by more is judged again",
        "5 of 13, no verdict", "5 of 13, no verdict",
    )  # fmt: skip
    several_records: float = _constant(
        3.0, "records", "that say something by their scatter, or agree on a small change along a record",
        "nothing", "13 of 13, no verdict",
    )  # fmt: skip
    records_agree: float = _constant(
        20.0, "variance ratio", "squared size of that change over its scatter between records",
        "nothing", "1 of 13, no verdict",
    )  # fmt: skip
    line_stands_out: float = _constant(
        30.0, "times the power around", "from which a line is none by chance",
        "13 of 13, no verdict", "13 of 13, no verdict",
    )  # fmt: skip
    steps_visible: float = _constant(
        0.3, "of the noise", "from which steps are no mere rounding of a file",
        "2 of 13, no verdict", "nothing",
    )  # fmt: skip
    coarser: float = _constant(
        0.6, "of the pressures' codes", "below which a position has a coarse sensor of its own",
        "nothing", "nothing",
    )  # fmt: skip

    # What is said

    negligible: float = _constant(
        0.005, "share of the motion", "no law of a library is that of a bench to five parts in a thousand",
        "2 of 13, no verdict", "3 of 13, no verdict",
    )  # fmt: skip
    immaterial: float = _constant(
        0.001, "share of the motion, in every channel",
        "less is nothing to anybody, however little noise the sensors have",
        "4 of 13, no verdict", "5 of 13, no verdict",
    )  # fmt: skip
    vague_drive: float = _constant(
        1.5, "mean square over noise", "what a drive that is known in part may leave",
        "4 of 13, no verdict", "nothing",
    )  # fmt: skip
    details: float = _constant(
        0.125, "share",
        "of what was to be explained or is left: less is a matter of a law's details; a law left 5 % at most",
        "nothing", "nothing",
    )  # fmt: skip
    right_law: float = _constant(
        9.0, "mean square over noise", "more is left by no right law: those rightly named left 7.2 at most",
        "nothing", "nothing",
    )  # fmt: skip
    remainder_seen: float = _constant(
        0.1, "of the noise", "below which what remains beyond it is that of the noise's own estimate",
        "4 of 13, no verdict", "5 of 13, no verdict",
    )  # fmt: skip
    below_noise: float = _constant(0.9, "σ", "below which the noise model is doubted", "nothing", "nothing")
    coloured: float = _constant(
        0.1, "correlation", "from which a residual is called coloured: over thousands of samples any model has some",
        "nothing", "2 of 13, no verdict",
    )  # fmt: skip
    shared: float = _constant(
        3.0, "times the scatter", "error of an effect's parameter, with what all segments and records share of it",
        "intervals of effects half as wide", "twice as wide",
    )  # fmt: skip
    law_error: float = _constant(
        0.01, "share of a value", "standard error of a parameter for the law that it stands in",
        "standard errors up to 0.5 % of the value smaller", "1 % larger",
    )  # fmt: skip
    shape_error: float = _constant(
        0.02, "share of a value", "the same of what shapes an effect's law, which others write down otherwise",
        "standard errors up to 1 % of the value smaller", "2 % larger",
    )  # fmt: skip
    vague_value: float = _constant(
        0.3, "share of a value", "standard error from which an interval is sought by what it costs",
        "more intervals are sought by fits", "fewer are",
    )  # fmt: skip
    surest: float = _constant(
        0.99, "probability", "nothing is said to be surer",
        "said up to 98 %", "said up to 99.5 %",
    )  # fmt: skip

    # How much is done

    most_effects: int = _effort(6, "effects", "together with data sheet and recording", "nothing on 2", "nothing on 2")
    most_swaps: int = _effort(3, "effects", "that take the place of others", "nothing on 2", "nothing on 2")
    most_stuck: int = _effort(2, "rivals", "that change the same and are fitted anew", "nothing on 2", "nothing on 2")
    most_faults: int = _effort(3, "faults", "of the recording", "nothing on 2", "nothing on 2")
    most_sizes: int = _effort(4, "fits", "that the size of a fault is sought in", "nothing on 2", "nothing on 2")
    most_refits: int = _effort(8, "candidates", "that are refitted at first", "nothing on 2", "nothing on 2")
    later_refits: int = _effort(4, "candidates", "once something was added", "nothing on 2", "nothing on 2")
    most_alike: int = _effort(
        2, "candidates", "of one subsystem then: what its laws left makes all of its effects look promising",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    most_finished: int = _effort(
        2, "candidates", "that are refitted from more than one start, and fitted to the end",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    most_others: int = _effort(
        3, "candidates", "that are set against the nearest where a quick refit is no sure guide",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    most_suspects: int = _effort(
        2, "numbers", "of the data sheet that are tried in the place of one",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    most_sets: int = _effort(2, "sets of numbers", "in whose place one effect is tried", "nothing on 2", "nothing on 2")
    enough_to_fit: int = _effort(60, "segments", "that do for a first fit", "nothing on 2", "nothing on 2")
    look: int = _effort(20, "segments", "that show where a fit from other values leads", "nothing on 2", "nothing on 2")
    fine_look: float = _effort(
        0.2, "share of what must be gained", "steps that gain less end such a fit",
        "7 of 13, no verdict", "8 of 13, no verdict",
    )  # fmt: skip
    few_steps: int = _effort(
        6, "steps", "of a fit that only sets effects against each other",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    few_gain: float = _effort(
        2e-3, "share of the sum of squares", "that its steps gain",
        "5 of 13, no verdict", "4 of 13, no verdict",
    )  # fmt: skip
    first_gain: float = _effort(
        0.02, "share of the sum of squares", "that steps gain while the noise is not known yet",
        "7 of 13, no verdict", "6 of 13, no verdict",
    )  # fmt: skip
    last_steps: int = _effort(
        8, "steps", "of a fit that begins where a quick refit ended",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    last_gain: float = _effort(
        5e-5, "share of the sum of squares", "that its steps gain",
        "13 of 13, no verdict", "11 of 13, no verdict",
    )  # fmt: skip
    shorter: int = _effort(
        4, "times", "shorter segments from which a fit that is far off begins once more",
        "one verdict of 2 names one area more", "nothing on 2",
    )  # fmt: skip
    beyond_bound: int = _effort(
        8, "values", "of a number at its bound, over all where it may go, from which a fit may begin",
        "nothing on 2", "one verdict of 2 names one area more",
    )  # fmt: skip
    most_judged: int = _effort(
        6, "rounds", "of estimating noise and delays and fitting again",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    enough_to_score: int = _effort(50, "segments", "that do for a look at candidates", "nothing on 2", "nothing on 2")
    many_probes: int = _effort(
        8, "groups of probes", "beyond which they are narrowed down on one record",
        "nothing on 2", "nothing on 2",
    )  # fmt: skip
    nearest_probes: int = _effort(4, "groups of probes", "that remain", "nothing on 2", "nothing on 2")
    too_far: float = _effort(
        1.0, "times what is left", "a probe that changes more is no first order",
        "11 of 13, no verdict", "11 of 13, no verdict",
    )  # fmt: skip
    too_near: float = _effort(
        0.01, "times what is left", "below which all probes change, larger ones are tried",
        "3 of 9, no verdict", "3 of 9, no verdict",
    )  # fmt: skip
    starts_as_well: float = _effort(
        0.5, "share of the best prediction", "from which another shape is a start as well",
        "12 of 13, no verdict", "13 of 13, no verdict",
    )  # fmt: skip


CRITERIA = Criteria()
