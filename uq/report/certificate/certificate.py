"""The certificate of an identified tensor, as far as the table ``[report]`` makes its report one."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from identify.display.reporting import Drawing, Result, Section, section_of
from identify.display.text_tables import Table, sentence
from identify.estimation.methods.base import estimator_of
from identify.results.identification_result import Identification
from identify.results.ledger import CONVENTIONAL, QUANTITIES
from uq.experiment.conformity import RULES, Decision, decide
from uq.experiment.report_table import Report, read
from uq.monte_carlo.coverage.expanded_uncertainty import Expanded, of_tensor
from uq.report.certificate import checks, tables
from uq.report.certificate.front import Front, front, not_stated
from uq.report.input_tables import source_tables
from uq.report.tables import identification as identification_view

TITLE = "Inertia tensor of a body"


@dataclass(frozen=True, repr=False)
class Certificate(Result):
    """An identification with what a laboratory's report adds: expanded uncertainties, conformity, particulars, checks.

    Example: ``write(Certificate(identify_files(["run.mcap"], experiment)), Path("folder"))``.
    """

    unit_of_columns = "kg·m²"

    identification: Identification

    @cached_property
    def report(self) -> Report:
        """Content of the table ``[report]``."""
        return read(self.identification.provenance)

    @cached_property
    def tensor(self) -> Expanded:
        """The components with their expanded uncertainty, by measured and declared errors [kg·m²]."""
        return of_tensor(self.identification, **self.report.coverage)

    @cached_property
    def checks(self) -> list[list[str]]:
        """The checks, a row each; the last counts the warnings."""
        return checks.rows(self.identification)

    @cached_property
    def decisions(self) -> list[Decision]:
        """Decision on each component with limits.

        By the conventional bound, where undeclared errors are known. None is made where the runs contradict what is
        declared; none is passed while undeclared errors are not known.
        """
        rule, result = self.report.conformity, self.identification
        u, half = result.with_undeclared.standard_uncertainty[4:], self.tensor.expanded
        if result.undeclared is not None:
            half = np.hypot(half, CONVENTIONAL * result.undeclared.standard_uncertainty[4:])
        decisions = [] if rule is None else decide(rule, result.inertia, u, half)
        return [
            replace(decision, outcome="undecided", probability=np.nan)
            if result.contradicted or (result.undeclared is None and decision.outcome == "conforms")
            else decision
            for decision in decisions
        ]

    @cached_property
    def missing(self) -> list[str]:
        """Names of the items that ISO/IEC 17025 asks for and ``[report]`` does not state."""
        return not_stated(self._front)

    @cached_property
    def _front(self) -> Front:
        signed = 1 + len(self._values())
        return front(self.report, self.identification.provenance, signed)

    def title(self) -> str:
        """Return the identification's."""
        return self.identification.title()

    def tables(self) -> list[Table]:
        """Return tensor, mass and centre, principal moments; behind the signature, conformity and u by origin."""
        result = self.identification
        return [
            tables.tensor(result, self.tensor),
            *self._values(),
            *tables.conformity(self.report, self.decisions),
            *tables.origins(result),
        ]

    def _values(self) -> list[Table]:
        """The tables that stand between tensor and signature: few rows, so that a page always holds them."""
        result = self.identification
        return [tables.mass_and_centre(result, self.report), *tables.principal(result, self.tensor)]

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
        """Return budget, undeclared errors, scatter, validation, alignment, tare, calibrations, checks, runs."""
        result = self.identification
        return [
            *tables.budget(result),
            *identification_view.undeclared_tables(result),
            *tables.scatter(result),
            *([] if result.validation is None else result.validation.tables()),
            *tables.discordance(result),
            *tables.bodies(result),
            *tables.alignment(result),
            *tables.tare(result),
            *tables.calibrations(result),
            tables.checked(self.checks),
            *tables.elsewhere(result),
            identification_view.run_table(result),
            *source_tables(result.provenance),
        ]

    def section(self) -> Section:
        """Return the certificate."""
        result, report = self.identification, self.report
        return section_of(
            self,
            title=report.texts.get("title", TITLE),
            computed=[f"{estimator_of(result.method).type_a} {UNCERTAINTY}".strip(), BIAS, *_decision_rule(report)],
            findings=self.findings(),
            not_stated=self.not_stated(),
            details=self.details(),
            assumptions=list(map(sentence, result.assumptions)),
            provenance=result.provenance
            if result.tare is None
            else {**result.provenance, "tare": result.tare.provenance},
            front=self._front,
            verdict=self.verdict(),
        )

    def verdict(self) -> str:
        """Return whether the figures may be used, conformity, and whether checks are passed and items stated."""
        rule, outcomes = self.report.conformity, {decision.component: decision.outcome for decision in self.decisions}
        contradicted = self.identification.contradicted
        trust = identification_view.trust(self.identification)
        texts = [sentence(f"{contradicted}: {NO_INTERVAL}") if contradicted else trust]
        if rule is not None and set(outcomes.values()) == {"conforms"}:
            texts.append(f"Conforms with {rule.specification}: {', '.join(outcomes)}.")
        elif rule is not None:
            texts.append(f"Conformity with {rule.specification}: {', '.join(f'{k} {v}' for k, v in outcomes.items())}.")
        failed = sum(row[-1] not in (checks.WITHIN, checks.NOT_DECLARED) for row in self.checks)
        if failed:
            texts.append(f"{failed} of {len(self.checks)} checks call{'s' if failed == 1 else ''} for attention.")
        if self.missing:
            count = len(self.missing)
            texts.append(
                f"{count} item{'s' * (count > 1)} of ISO/IEC 17025 {'is' if count == 1 else 'are'} not stated."
            )
        every = all(row[-1] == checks.WITHIN for row in self.checks) and not self.missing
        return " ".join([*texts, "Every check is passed."] if every else texts)

    def findings(self) -> list[str]:
        """Return what a reader must not miss: conformity, warnings, checks."""
        failed = [
            f"{row[0]}: {row[1]}, limit {row[2]}."
            for row in self.checks[:-1]
            if row[-1] not in (checks.WITHIN, checks.NOT_DECLARED)
        ]
        why = {"undecided": self._undecided} if self._undecided else {}
        others = [
            f"{decision.component}: {decision.outcome} {why.get(decision.outcome, 'by the decision rule')}."
            for decision in self.decisions
            if decision.outcome != "conforms"
        ]
        warnings = self.identification.warnings
        where = map(sentence, identification_view.explained(self.identification))
        return [*others, *warnings, *([] if warnings else failed), *where]

    def not_stated(self) -> list[str]:
        """Return what takes the tick away without being a warning: undeclared errors, items that nobody states."""
        missing = ", ".join(self.missing)
        items = [f"Not stated, and asked for by ISO/IEC 17025: {missing}."] if self.missing else []
        return [*self._typical(), *items]

    @property
    def _undecided(self) -> str:
        """Reason why no decision is made, whatever the rule; '': the rule decides."""
        if self.identification.contradicted:
            return CONTRADICTED
        return UNDECIDED if self.identification.undeclared is None else ""

    def _typical(self) -> list[str]:
        """Return how far undeclared errors exceed all others, where that is too much for a tick."""
        result, row = self.identification, checks.undeclared(self.identification)
        if row[-1] == checks.WITHIN:
            return []
        gap = None if result.undeclared is None else result.undeclared.largest(result.parameters.standard_uncertainty)
        if result.undeclared is None or gap is None:
            return ["What undeclared errors would add is not known."]
        name, figures = QUANTITIES[gap.parameter][0], gap.row
        return [
            f"U leaves out errors that nobody declared: at typical size their u is up to {row[1]} times that of all "
            f"others, and the conventional bound holds them. The largest part, {100 * gap.share:.0f} % of u² of {name} "
            f"with them, is {figures.text} ({figures.figure}). "
            f"{CURE}"
        ]


def _decision_rule(report: Report) -> list[str]:
    rule = report.conformity
    return [] if rule is None else [f"Decision rule for conformity with {rule.specification}: {RULES[rule.rule]}."]


CURE = "Declare it as [[source]], or state your figure in [undeclared], false for none."
UNDECIDED = "while undeclared errors are not known"
CONTRADICTED = "while the runs contradict what is declared"
NO_INTERVAL = "no interval is certified"
UNCERTAINTY = (
    "What is declared or known beforehand, the centre of gravity among it, is type B (GUM 4.2, 4.3, 5.1). The coverage "
    "interval is from the distributions of both: k = 1.96 where they are normal, larger where few runs determine the "
    "scatter. The conventional bound adds to it, in quadrature, twice the standard uncertainty of errors that nobody "
    "declared, at typical size. These sizes are known to 30 to 50 %, so that the bound states no coverage probability."
)
BIAS = (
    "The bias is the expected mean error from the gyro's noise in the regressor and from the declared sources. It is "
    "stated, not subtracted from the value; the interval allows for it (GUM F.2.4.5)."
)
