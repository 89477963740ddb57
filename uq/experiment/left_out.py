"""An experiment without some of its file's sources, by their names or kinds."""

from collections.abc import Sequence
from dataclasses import replace

from rig.exceptions import listed, quoted
from uq.experiment.experiment import Experiment
from uq.files.document import ExperimentError


def leave_out(experiment: Experiment, which: Sequence[str]) -> Experiment:
    """Return the experiment without the sources of these names or kinds, and without what correlates them.

    A name may have spaces for its underscores, as tables print it. The result remembers what was left out.

    Raises:
        ExperimentError: no source has such a name or kind.
    """
    if not which:
        return experiment
    of_words: dict[str, list[str]] = {}
    for source in experiment.sources:
        for word in (source.name, source.kind):
            of_words.setdefault(word.replace(" ", "_"), []).append(source.name)
    left_out: dict[str, None] = {}
    for wanted in which:
        names = of_words.get(wanted.replace(" ", "_"))
        if names is None:
            sources, kinds = (dict.fromkeys(getattr(s, key) for s in experiment.sources) for key in ("name", "kind"))
            choices = f"choose a name of [[source]] ({listed(sources)}) or a kind ({listed(kinds)})"
            raise ExperimentError(f"no source to leave out has the name or kind {quoted(wanted)}: {choices}")
        left_out |= dict.fromkeys(names)
    document = dict(experiment.document)
    document["source"] = [table for table in document["source"] if table["name"] not in left_out]
    links = [link for link in document.pop("correlation", []) if not left_out.keys() & set(link["sources"])]
    document |= {"correlation": links} if links else {}
    reduced = Experiment.from_dict(document, experiment.folder)
    return replace(reduced, file=experiment.file, left_out=(*experiment.left_out, *left_out))


def left_out_note(experiment: Experiment) -> list[str]:
    """Return what a result says of the sources that were left out; nothing where none was."""
    names = ", ".join(name.replace("_", " ") for name in experiment.left_out)
    return [f"left out, so not in any figure: {names}"] if names else []
