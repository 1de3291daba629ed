"""The comment above a layer: the measurement and the settings of its round."""

from collections.abc import Sequence

from tablegen.base.data_files import Source
from tablegen.refinement.image_round import ImageRound, MismatchRound
from tablegen.refinement.round import Round, TraceRound, worst_scaling


def provenance(learnt_round: Round, sources: Sequence[Source], stopped: bool = False) -> str:
    """Format the comment on the sources of a round, or why the layer before it stays; no date."""
    update = learnt_round.update
    facts = []
    for source in sources:
        name = source.name if source.name.isprintable() else ascii(source.name)
        facts.append(f"{name}, sha256 {source.sha256}")
    if isinstance(learnt_round, TraceRound):
        facts.append(f"{learnt_round.displacement.periods:.4g} periods")
    if isinstance(learnt_round, ImageRound):
        facts.append(f"{learnt_round.periods:.4g} periods in the line")
    if isinstance(learnt_round, MismatchRound):
        facts.append("trace against retrace")
    return ", ".join(
        [
            *facts,
            f"residual {update.before.rms_percent:.3g} % rms",
            *(
                [f"scaling error {worst_scaling(update):.3g} %, larger than before: the layer before it was kept"]
                if stopped
                else [f"harmonics to {update.harmonics}", f"gain {learnt_round.bound.gain:g}"]
            ),
        ]
    )
