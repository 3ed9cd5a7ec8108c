"""The flow chart of a verdict as SVG: `python docs/explanation/verdict_flow.py` writes
verdict.svg."""

from pathlib import Path

STEPS = (  # what happens, lines joined by |; what leads down; the side exit, if any
    ("waves of one gyro", "", None),
    (
        "is one run, or one log,|not what it says it is?",
        "no",
        ("yes", "the run is named, no physics|is blamed; exit 3"),
    ),
    ("base model fitted to all runs", "", None),
    ("score of every effect beside it", "", None),
    (
        "chance below SIGNIFICANT|and worth WORTH?",
        "no",
        ("yes", "refit with it and its rivals,|then score again"),
    ),
    ("swaps and backward check", "", None),
    ("open search for what no catalogue|holds, weighed against the causes", "", None),
    ("extended model written, and|simulated from its own file", "", None),
    (
        "closing checks: do all pass?",
        "yes",
        ("no", "partly explained, or unexplained:|suspect, with the reason"),
    ),
    ("adequate, or explained|by the causes", "", None),
)
WIDTH, HEIGHT, GAP, LEFT, SIDE = 250, 44, 26, 10, 330
PITCH = HEIGHT + GAP
ARROW = '<path d="M{} {} L{} {}" stroke="#345" fill="none" marker-end="url(#tip)"/>'


def box(x: int, y: int, text: str, fill: str) -> str:
    """A rounded box with its lines of text in the middle."""
    lines = text.split("|")
    top = y + HEIGHT / 2 - 8 * (len(lines) - 1) + 4
    words = "".join(
        f'<text x="{x + WIDTH / 2:g}" y="{top + 16 * k:g}" text-anchor="middle">{line}</text>'
        for k, line in enumerate(lines)
    )
    return (
        f'<rect x="{x}" y="{y}" width="{WIDTH}" height="{HEIGHT}" rx="7" fill="{fill}"'
        f' stroke="#345"/>{words}'
    )


def chart() -> str:
    """The whole chart."""
    parts = []
    middle = LEFT + WIDTH // 2
    for k, (text, down, exit_) in enumerate(STEPS):
        y = 10 + k * PITCH
        parts.append(box(LEFT, y, text, "#fff3d6" if exit_ else "#e8f0f8"))
        if k + 1 < len(STEPS):
            parts.append(ARROW.format(middle, y + HEIGHT, middle, y + PITCH - 2))
            parts.append(f'<text x="{middle + 8}" y="{y + HEIGHT + 17}">{down}</text>')
        if exit_:
            parts.append(box(SIDE, y, exit_[1], "#f4f4f4"))
            parts.append(ARROW.format(LEFT + WIDTH, y + HEIGHT // 2, SIDE - 2, y + HEIGHT // 2))
            parts.append(
                f'<text x="{LEFT + WIDTH + 22}" y="{y + HEIGHT // 2 - 6}">{exit_[0]}</text>'
            )
        if exit_ and "again" in exit_[1]:
            parts.append(ARROW.format(SIDE, y, LEFT + WIDTH + 2, y - PITCH + HEIGHT // 2))
    size = f'width="{SIDE + WIDTH + 10}" height="{10 + len(STEPS) * PITCH}"'
    head = '<path d="M0 0 L8 4 L0 8 z" fill="#345"/>'
    tip = (
        '<defs><marker id="tip" markerWidth="8" markerHeight="8" refX="7" refY="4"'
        f' orient="auto">{head}</marker></defs>'
    )
    style = 'font-family="sans-serif" font-size="13" fill="#123"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style}>\n<rect width="100%" height="100%"'
        f' fill="white"/>{tip}\n' + "\n".join(parts) + "\n</svg>\n"
    )


if __name__ == "__main__":
    Path(__file__).with_name("verdict.svg").write_text(chart(), encoding="utf-8")
