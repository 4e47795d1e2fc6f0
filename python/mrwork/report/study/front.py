"""The front of a study's page: the building, its peaks over the height, and what each law is worth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure

from mrwork.base.numbers import NOTHING, counted, format_fixed, least_to_most, significant
from mrwork.base.summary import list_names
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import criterion
from mrwork.plots.canvas import coinciding, inline_svg, small_axes
from mrwork.plots.of_buildings import building
from mrwork.plots.of_studies import RATIO, Stroke, short, strokes
from mrwork.report.section import Lead, Panel, first_sentences, panel
from mrwork.report.study.figures import profile_figure
from mrwork.study.comparison import (
    BOTH,
    Comparison,
    beaten_in_words,
    is_tied,
    lowers_all,
    peaks_in_words,
    scored_in_words,
    signed_percent,
    times_better,
    verdict,
)
from mrwork.study.fragilities import Fragilities
from mrwork.study.results import StudyResults, bands_over
from mrwork.study.row_kinds import LAWS
from mrwork.study.tables import MOST_DRAWN
from mrwork.tuning.judging import TunedStudy

# Laws with colours and rows in the table; cautions; modes and motions that are named.
_LAWS, _CAUTIONS, _ADVICE, _MODES, _NAMED = 6, 3, 2, 3, 2
# Ranks of laws and of devices with power or settings of their own, in the order of the table.
_ACTIVE = ("law", "actuator", "other_device")
# Size of the line of a row in the table [in].
_LINE = (0.26, 0.08)
# Floors of a building that can be drawn.
_MOST_FLOORS = 100


def messages_of_page(results: StudyResults, fragilities: Fragilities | None) -> list[str]:
    """The messages of all remarks of a page, those of warnings first."""
    remarks = dict.fromkeys((*results.remarks, *(() if fragilities is None else fragilities.remarks)))
    return [each.message for each in sorted(remarks, key=lambda remark: remark.severity != "warning")]


def study_lead(comparison: Comparison, fragilities: Fragilities | None = None) -> Lead:
    """The front of the page of a study, with the fragilities of its records at several levels."""
    results = comparison.results
    drawn = drawn_rows(comparison)
    places = results.tuned.places if isinstance(results, TunedStudy) else ()
    placed = (
        f" Best of {counted(len(places), 'placement')} of the dampers: {places[0].in_words}."
        if places
        else ""
    )
    subject = "Response" if results.building.parts else "Response of a building"
    return Lead(
        eyebrow="Control laws tuned, and the response with them"
        if isinstance(results, TunedStudy)
        else f"{subject} with {'actuators' if results.command_unit == 'N' else 'MR dampers'}",
        title=results.title,
        subject=_subject(results),
        synthetic=any(motion.synthetic for motion in results.motions),
        verdict=f"{_verdict(comparison)}{'' if fragilities is None else _medians(comparison, fragilities)}{placed}",
        banner=""
        if results.complete
        else f"This study was interrupted: {results.done} of {results.total} runs are done. Run it with --resume to "
        "continue.",
        panels=(*_building_panel(results), *_profile_panels(results, drawn)),
        table=_table(comparison, drawn),
        cautions=first_sentences(messages_of_page(results, fragilities), _CAUTIONS),
        advice=_advice(comparison),
    )


def _subject(results: StudyResults) -> str:
    uses = results.motions.in_words
    motions = [results.motions[motion].name for motion in results.judged_motions]
    names = f"{uses}: {list_names(motions, _NAMED)}"
    facts = results.building
    periods = [significant(period, 3) for period in facts.periods[:_MODES] if np.isfinite(period)]
    ratios = [format_fixed(100.0 * ratio, 1) for ratio in facts.damping_ratios[:_MODES] if np.isfinite(ratio)]
    storeys = list_names(facts.parts, _NAMED) or (
        counted(len(facts.stiffnesses), "storey") if facts.stiffnesses else f"{len(facts.masses)} floors"
    )
    same = len({*ratios}) == 1
    damping = f", damping {', '.join(ratios[:1] if same else ratios)} %" if ratios else ""
    mass = significant(1e-3 * facts.total_mass, 3)
    height = f", {significant(sum(facts.heights), 3)} m" if facts.heights else ""
    drifts = [1e3 * drift for drift in facts.yield_drifts if drift]
    yields = f", yields at {least_to_most(drifts)} mm of drift" if drifts else ""
    weights = ", P-delta" if facts.loads else ""
    return f"{storeys}{height}, {mass} t, periods {', '.join(periods)} s{damping}{yields}{weights}; under {names}"


def _medians(comparison: Comparison, fragilities: Fragilities) -> str:
    rows = (comparison.leading, comparison.passive, comparison.uncontrolled)
    labels = dict.fromkeys(comparison.results.rows[row].label for row in rows if row is not None)
    shown = [label for label in labels if label in fragilities.rows] or [*fragilities.rows][:1]
    medians = ", ".join(f"{fragilities[label].brief} with {label}" for label in shown)
    return f" Median {fragilities[shown[0]].measure} at which {fragilities.limit_in_words}: {medians}."


def _changes_of(comparison: Comparison, row: int, reference: int) -> dict[str, Floats]:
    ratios, judged = comparison.results.ratios_over(reference), [*comparison.results.judged_motions]
    return {name: ratios[name][row, judged] - 1.0 for name in BOTH}


def _verdict(comparison: Comparison) -> str:
    """Whether a law beats the best constant command in both peaks, by how much, and under how many motions."""
    results, passive, judged = (comparison.results, comparison.passive, comparison.results.motions.in_words)
    laws = next((rows for rank, rows in comparison.ranks if rank is LAWS), ())
    if not results.is_compared:
        return f"{counted(len(laws), 'law')} under {judged}, without the best constant command beside them."
    if not laws or passive is None:
        if comparison.leading is None:
            return f"{counted(len(results.rows), 'arrangement')} under {judged}."
        changes = _changes_of(comparison, comparison.leading, comparison.uncontrolled)
        label = results.rows[comparison.leading].label
        return f"No control law is compared. {label} against no dampers: {peaks_in_words(changes)}."
    every = {row: _changes_of(comparison, row, passive) for row in laws}
    # The law of the lowest score is the first one.
    row, constant, motions = laws[0], results.rows[passive].label, len(results.judged_motions)
    over = f"{constant} on average over {judged}" if motions > 1 else constant
    if results.has_own_score:
        tied = "; within the spread of the motions they are equal" if is_tied(results, row, passive) else ""
        return f"{scored_in_words(results, row, passive, over)}{tied}."
    lower = [row for row, changes in every.items() if lowers_all(changes)]
    if lower and lower[0] != row:
        best = f"{results.rows[row].label} has the lowest score, {results.score(row).mean:.3f}: "
        other = beaten_in_words(results.rows[lower[0]].label, over, every[lower[0]])
        return f"{best}{peaks_in_words(every[row])}. {other}, with a score of {results.score(lower[0]).mean:.3f}."
    both = times_better(results, row, passive) if motions > 1 else None
    under = "" if both is None else f", both lower under {both} of {motions}"
    tied = "; within the spread of the motions they are equal" if is_tied(results, row, passive) else ""
    beaten = beaten_in_words(results.rows[row].label, over, every[row])
    if (band := bands_over(results, row, passive).get(BOTH[0])) is not None:
        ends = f"{signed_percent(band.lower - 1.0)} to {signed_percent(band.upper - 1.0)} %"
        beaten += f"; drift {ends} in 90 % of {results.n_realisations} realisations"
    return f"{beaten}{under}{tied}."


def drawn_rows(comparison: Comparison) -> list[int]:
    """The first laws and the references: those with a line in the table; more rows are drawn in grey."""
    active = [(rank, row) for rank, rows in comparison.ranks if rank.name in _ACTIVE for row in rows]
    many = sum(rank is LAWS for rank, _ in active) >= _LAWS - 1
    on, off = (comparison.results.row_of(kind) for kind in ("passive", "passive_off"))
    references = (row for row in comparison.constants if not (many and row == off))
    # Passive-on has a colour as a law has.
    laws = active[: _LAWS if on is None else _LAWS - 1]
    return [*dict.fromkeys([*(row for _, row in laws), *references, comparison.uncontrolled])]


def _table(comparison: Comparison, drawn: Sequence[int]) -> Table:
    """A row for each drawn arrangement with its line: score, changes of both peaks, and the verdict."""
    results = comparison.results
    of_row = strokes(results, drawn)
    laws = next((rows for rank, rows in comparison.ranks if rank is LAWS), ())
    others = {
        results.row_of("passive_off"): "dampers without a command",
        results.row_of("passive"): "the largest command",
        comparison.passive: "the reference",
    }
    # The best constant command first.
    references = comparison.references[::-1]
    # The peak drift ratio, mean over the judged motions, where heights are known.
    has_ratios = results.building.has_ratios
    peaks = results.criteria_of_runs.numbers["peak_drift_ratio"][:, list(results.judged_motions), 0].mean(
        axis=1
    )

    def cells(row: int) -> tuple[str, ...]:
        return (
            _line(of_row[row], row) + Markup(" {}").format(short(results.rows[row].label, 34)),
            verdict(comparison, row) if row in laws else others.get(row, ""),
            format_fixed(results.score(row).mean, 3),
            *([significant(100.0 * peaks[row], 3)] if has_ratios else []),
            *(
                NOTHING if row == reference else signed_percent(comparison.tables[row, reference][name].mean)
                for reference in references
                for name in BOTH
            ),
        )

    more = len(set(laws) - set(drawn))
    ratio_head = ("Drift ratio (%)",) if has_ratios else ()
    heads = [f"Against {results.rows[reference].label.partition(',')[0]} (%)" for reference in references]
    return Table(
        label="What each law is worth",
        # In a narrow window the numbers are scrolled, and the verdict is not.
        columns=("", "Verdict", "Score", *ratio_head, *(("Drift", "Acc.") * len(references))),
        rows=tuple(map(cells, drawn)),
        over=(("", 3 + len(ratio_head)), *((head, 2) for head in heads)),
        note=f"{counted(more, 'more law')} below, in grey above." if more else "",
    )


def _line(stroke: Stroke, row: int) -> Markup:
    figure = Figure(figsize=_LINE)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, 2.0), ylim=(-1.0, 1.0))
    axes.set_axis_off()
    axes.plot([0.1, 1.0, 1.9], [0.0, 0.0, 0.0], markevery=[1], markersize=4.0, **stroke.marked)
    drawn = inline_svg(figure, identifier=f"line-{row}", description="")
    return Markup('<span class="line" aria-hidden="true">{}</span>').format(Markup(drawn))


def _profile_panels(results: StudyResults, drawn: Sequence[int]) -> Iterator[Panel]:
    """Peaks over the height, means over the judged motions; the range over these of the first row is shaded."""
    judged = results.judged_motions
    rows = [*dict.fromkeys([*drawn, *range(len(results.rows))])][:MOST_DRAWN]
    finished = set(rows).intersection(*(results.finished_rows(motion) for motion in judged))
    named = [row for row in drawn if row in finished]
    if not named:
        return
    shaded = f"Means; shaded, the range of {results.rows[named[0]].label}." if len(judged) > 1 else ""
    for name in BOTH:
        quantity = RATIO if results.building.has_ratios and name == BOTH[0] else name
        title = criterion(quantity).title
        figure = profile_figure(results, quantity, named, [row for row in rows if row not in drawn])
        curves = figure.axes[0].get_lines()[: len(named)]
        lines = {str(line.get_label()): np.asarray(line.get_xdata()) for line in curves}
        yield panel(
            f"front-{name.replace('_', '-')}",
            title,
            figure,
            f"{title} over the height, {len(finished)} arrangements, mean over {results.motions.in_words}",
            " ".join([shaded, coinciding(lines)]).strip(),
        )
        shaded = ""


def _building_panel(results: StudyResults) -> Iterator[Panel]:
    facts = results.building
    # With additions there are more masses than storeys.
    if len(facts.stiffnesses) != len(facts.masses) or len(facts.masses) > _MOST_FLOORS:
        return
    dampers = [
        f"{format_fixed(damper.count, 0)} in {damper.place or f'storey {damper.storey + 1}'}"
        for damper in results.dampers
    ]
    dampers += facts.passive
    figure, axes = small_axes()
    axes.set_position((0.02, 0.02, 0.96, 0.94))
    building(results, axes)
    yield panel(
        "front-building",
        facts.name[:1].upper() + facts.name[1:] if facts.parts else "Building",
        figure,
        f"{facts.name}: {len(facts.masses)} masses and their stiffnesses; dampers: "
        f"{', '.join(dampers) or 'none'}",
        f"Dampers: {list_names(dampers, 4)}" if dampers else "No dampers",
    )


def _advice(comparison: Comparison) -> tuple[str, ...]:
    results = comparison.results
    advice = (
        (
            isinstance(results, TunedStudy),
            "`mrwork respond chosen.toml`, in this folder: the study with these settings.",
        ),
        (not results.step_checked, "`--check-step`: whether half the step changes a number."),
        (
            len(results.judged_motions) < 5,
            "More `[[motion]]` tables: a law is worth what it does under motions that did not make it.",
        ),
        (
            not results.n_realisations,
            "`[uncertainty]` in the study: the same with dampers and a building that are not known exactly.",
        ),
        (True, "`mrwork tune STUDY`: settings of the laws from training motions, judged on test motions."),
    )
    return tuple(sentence for lacks, sentence in advice if lacks)[:_ADVICE]
