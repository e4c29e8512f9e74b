"""The sub-command that writes a policy for other programs."""

from pathlib import Path

from .arguments import Allow, PolicyName


def export(
    policy: PolicyName,
    /,
    *,
    out: Path,
    result: Path | None = None,
    licence: str | None = None,
    allow: Allow = (),
) -> None:
    """Write a policy for other programs: ONNX, safetensors, Stable-Baselines3, a model card.

    The ONNX file is compared with the policy on 10,000 random observations first. The folder is
    one that Hugging Face takes as it is. Needs pip install -e '.[export]' in a checkout.

    Args:
        policy: a packaged policy (see poise list) or a folder written by poise train.
        out: folder to write to: new, or empty.
        result: a folder of poise evaluate or poise benchmark in which the policy took part, or its
            summary.json: its figures go into the card.
        licence: of the policy, as Hugging Face abbreviates it; of a packaged one it is known.
    """
    from poise.training.trials.names import check_policy_name

    check_policy_name(policy)
    from poise.training.export.export import export_policy

    worst = export_policy(policy, out, result=result, licence=licence, allow=allow)
    print(f"{out}: ONNX differs from the policy by {worst:.1g} at most")
