"""A build as HTML for notebooks: drive and error as SVG, and the certificate. Nothing is loaded from a network."""

from html import escape

from tablegen.certificate.certificate import Certificate
from tablegen.certificate.scan_warnings import brief_warnings
from tablegen.certificate.summary import certificate_lines, drive_lines, rate
from tablegen.charts.svg import embedded
from tablegen.html_report.scan_charts import drive_of, modelled_error
from tablegen.planning.line_plan import Plan


def build_html(plan: Plan, certificates: dict[str, Certificate]) -> str:
    """Return a self-contained fragment of HTML."""
    schedule = plan.schedule
    title = f"{plan.name} on {plan.scanner}: {rate(schedule.line_rate)} lines of {schedule.ticks} ticks"
    parts = [
        f"<p><b>{escape(title)}</b>, {schedule.lines} lines a frame, {escape(rate(schedule.frame_rate))} frames</p>"
    ]
    parts += [f"<p><b>warning</b>: {escape(text)}</p>" for text in brief_warnings(plan, certificates)]
    for line in plan.moving:
        parts.append(f"<div>{embedded([drive_of(line, plan.schedule), modelled_error(plan, line)])}</div>")
        rows = [*drive_lines(line), *certificate_lines(certificates[line.axis])]
        cells = "".join(f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>" for name, value in rows)
        parts.append(f"<details><summary>{line.axis}: drive and certificate</summary><table>{cells}</table></details>")
    return "\n".join(parts)
