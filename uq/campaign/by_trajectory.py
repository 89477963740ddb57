"""A result by trajectory and estimator: ``result["T1", "central"]``."""

from collections.abc import Mapping
from typing import Any, Generic, TypeVar

from identify.exceptions import UnknownNameError
from identify.reporting import Shown

Content = TypeVar("Content", bound=Shown)


class ByTrajectory(Generic[Content]):
    """Base of the results of campaigns, laws and budgets, which hold one entry for each trajectory and estimator."""

    breakdowns: Mapping[str, Mapping[str, Content]]
    """Entries by trajectory, then by estimator."""

    def __getitem__(self, key: tuple[str, str] | str) -> Content:
        trajectory, estimator = self.checked(key)
        return self.breakdowns[trajectory][estimator]

    def checked(self, key: tuple[str, str] | str) -> tuple[str, str]:
        """Return a key under which there is something.

        Raises:
            KeyError: there is nothing; the message names what there is.
        """
        if not isinstance(key, tuple) or key not in self.pairs():
            raise UnknownNameError(key, self.pairs())
        return key

    def pairs(self) -> list[tuple[str, str]]:
        """Return every trajectory with every estimator."""
        return [(trajectory, estimator) for trajectory, names in self.breakdowns.items() for estimator in names]

    def records(self) -> list[dict[str, Any]]:
        """Return the records of every trajectory and estimator, in g·m², which these two name."""
        return [
            {"trajectory": trajectory, "estimator": estimator, **record}
            for trajectory, estimator in self.pairs()
            for record in self[trajectory, estimator].records()
        ]

    def _ipython_key_completions_(self) -> list[tuple[str, str]]:
        return self.pairs()
