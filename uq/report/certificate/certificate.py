"""The certificate of an identified tensor, as far as the table ``[report]`` makes its report one."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from identify.methods.base import estimator_of
from identify.reporting import Drawing, Result, Section
from identify.results.contributions import QUANTITIES, NotIncluded
from identify.results.identification_result import Identification
from identify.text_tables import Table, sentence
from uq.coverage.expanded_uncertainty import Expanded, of_tensor
from uq.experiment.conformity import RULES, Decision, decide
from uq.experiment.report_table import Report, read
from uq.report.certificate import checks, tables
from uq.report.certificate.front import front
from uq.report.input_tables import source_tables
from uq.report.tables import identification as identification_view

TITLE = "Inertia tensor of a body"


@dataclass(frozen=True, repr=False)
class Certificate(Result):
    """An identification with what a laboratory's report adds: expanded uncertainties, conformity, particulars, checks.

    Example: ``write(Certificate(identify_files(["run.mcap"], experiment)), Path("folder"))``.
    """

    identification: Identification

    @cached_property
    def report(self) -> Report:
        """Content of the table ``[report]``."""
        return read(self.identification.provenance)

    @cached_property
    def tensor(self) -> Expanded:
        """The components with their expanded uncertainty [kg·m²]."""
        report = self.report
        return of_tensor(self.identification, factor=report.coverage_factor, probability=report.coverage_probability)

    @cached_property
    def checks(self) -> list[list[str]]:
        """The checks, a row each; the last counts the warnings."""
        return checks.rows(self.identification)

    @cached_property
    def left_out(self) -> str:
        """Sentence on what U leaves out, where that is too much to pass anything; else empty."""
        if checks.undeclared(self.identification)[-1] == checks.WITHIN:
            return ""
        effects = self.identification.not_included
        if effects is None:
            return "What undeclared errors would add to U is not known."
        largest = largest_beside(effects, self.identification.parameters.standard_uncertainty)
        return f"U leaves out undeclared errors, typically {largest}."

    @cached_property
    def decisions(self) -> list[Decision]:
        """Decision on each component with limits; none is passed while U leaves out too much."""
        rule, t = self.report.conformity, self.tensor
        decisions = [] if rule is None else decide(rule, t.value, t.standard, t.expanded)
        return [
            replace(decision, outcome="undecided", probability=np.nan)
            if self.left_out and decision.outcome == "conforms"
            else decision
            for decision in decisions
        ]

    def title(self) -> str:
        """Return the identification's."""
        return self.identification.title()

    def tables(self) -> list[Table]:
        """Return tensor, mass and centre, principal moments, conformity."""
        result, report = self.identification, self.report
        return [
            tables.tensor(result, self.tensor),
            tables.mass_and_centre(result, report),
            *tables.principal(result, report),
            *tables.conformity(report, self.decisions),
        ]

    def overview(self) -> list[Table]:
        """Return the identification's, and conformity with a specification."""
        return [*self.identification.overview(), *tables.conformity(self.report, self.decisions)]

    def notes(self) -> list[str]:
        """Return the identification's."""
        return self.identification.notes()

    def drawings(self) -> list[Drawing]:
        """Return the identification's."""
        return self.identification.drawings()

    def records(self) -> list[dict[str, Any]]:
        """Return the identification's."""
        return self.identification.records()

    def to_dict(self) -> dict[str, Any]:
        """Return the identification's content; a file adds the certificate's number."""
        return self.identification.to_dict()

    def details(self) -> list[Table]:
        """Return budget, what is not included, scatter, validation, alignment, tare, checks, runs, sources."""
        result = self.identification
        return [
            *tables.budget(result),
            *identification_view.not_included_tables(result),
            *tables.scatter(result),
            *([] if result.validation is None else result.validation.tables()),
            *tables.discordance(result),
            *tables.bodies(result),
            *tables.alignment(result),
            *tables.tare(result),
            tables.checked(self.checks),
            *tables.elsewhere(result),
            identification_view.run_table(result),
            *source_tables(result.provenance),
        ]

    def section(self) -> Section:
        """Return the certificate."""
        result, report = self.identification, self.report
        return Section(
            title=report.texts.get("title", TITLE),
            computed=[f"{estimator_of(result.method).type_a} {UNCERTAINTY}".strip(), BIAS, *_decision_rule(report)],
            findings=self.findings(),
            tables=self.tables(),
            drawings=self.drawings(),
            details=self.details(),
            assumptions=list(map(sentence, result.assumptions)),
            provenance=result.provenance
            if result.tare is None
            else {**result.provenance, "tare": result.tare.provenance},
            front=front(report, result.provenance, len(self.tables())),
            verdict=self.verdict(),
        )

    def verdict(self) -> str:
        """Return what U leaves out, the statement of conformity, if one is asked for, and whether checks are passed."""
        rule, outcomes = self.report.conformity, {decision.component: decision.outcome for decision in self.decisions}
        texts = [self.left_out] if self.left_out else []
        if rule is not None and set(outcomes.values()) == {"conforms"}:
            texts.append(f"Conforms with {rule.specification}: {', '.join(outcomes)}.")
        elif rule is not None:
            texts.append(f"Conformity with {rule.specification}: {', '.join(f'{k} {v}' for k, v in outcomes.items())}.")
        failed = sum(row[-1] != checks.WITHIN for row in self.checks)
        if not failed:
            texts.append("Every check is passed.")
        elif failed > bool(self.left_out):
            texts.append(f"{failed} of {len(self.checks)} checks call{'s' if failed == 1 else ''} for attention.")
        return " ".join(texts)

    def findings(self) -> list[str]:
        """Return what a reader must not miss: what U leaves out, warnings, checks beyond their limit, conformity."""
        failed = [
            f"{row[0]}: {row[1]}, limit {row[2]}."
            for row in self.checks[:-1]
            if row[-1] != checks.WITHIN and row[0] != checks.UNDECLARED
        ]
        why = {"undecided": UNDECIDED} if self.left_out else {}
        others = [
            f"{decision.component}: {decision.outcome} {why.get(decision.outcome, 'by the decision rule')}."
            for decision in self.decisions
            if decision.outcome != "conforms"
        ]
        left_out = [f"{self.left_out} {CURE}"] if self.left_out else []
        warnings = self.identification.warnings
        where = map(sentence, identification_view.explained(self.identification))
        return [*left_out, *others, *warnings, *([] if warnings else failed), *where]


def largest_beside(effects: NotIncluded, u: np.ndarray) -> str:
    """Return in words what undeclared errors would add together, where that is most beside u of the ten, in SI."""
    _, worst = effects.share(u)
    name, unit, factor = QUANTITIES[worst]
    added, own = (identification_view.two_digits(factor * value[worst]) for value in (effects.together, u))
    return f"{added} {unit} in {name} beside u = {own}"


def _decision_rule(report: Report) -> list[str]:
    rule = report.conformity
    return [] if rule is None else [f"Decision rule for conformity with {rule.specification}: {RULES[rule.rule]}."]


CURE = "Declare them as [[source]], or state your own figures in [not_included], false for none."
UNDECIDED = "while U leaves out undeclared errors"
UNCERTAINTY = (
    "What is declared or known beforehand, the centre of gravity among it, is type B (GUM 4.2, 4.3, 5.1). The coverage "
    "interval is from the distributions of both: k = 1.96 where they are normal, larger where few runs tell the "
    "scatter."
)
BIAS = (
    "The bias is the expected mean error from the gyro's noise in the regressor and from the declared sources. It is "
    "stated, not subtracted from the value; the interval allows for it (GUM F.2.4.5)."
)
