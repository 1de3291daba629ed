"""A plan and its certificates to a map of file name to content; nothing touches the disk here."""

from functools import cache
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from tablegen.certificate.certificate import Certificate
from tablegen.emit.context import template_context
from tablegen.emit.memory import memory_files
from tablegen.manifest.format import MANIFEST, content_hash
from tablegen.manifest.record import plan_record
from tablegen.manifest.write import manifest_file
from tablegen.planning.line_plan import Plan
from tablegen.resources import c_link, c_runtime, resource_folder, verilog_runtime


def render(plan: Plan, certificates: dict[str, Certificate]) -> dict[str, bytes]:
    """Every file of a build: what is its own, the runtime, and the manifest last."""
    record = plan_record(plan)
    digest = content_hash(record)
    context = template_context(plan, certificates, digest)
    files = {f"{plan.name}.h": _template("c/tables.h.j2", context)}
    if not plan.header_only:
        files[f"{plan.name}.c"] = _template("c/tables.c.j2", context)
    files[f"{plan.name}.vh"] = _template("verilog/tables.vh.j2", context)
    fourier = {line.axis: line.fourier.in_order for line in plan.lines}
    files |= memory_files(plan.name, plan.schedule, plan.x.program, plan.y.program, fourier)
    files |= runtime_files()
    files[MANIFEST] = manifest_file(record, digest, certificates, files)
    return files


@cache
def runtime_files() -> dict[str, bytes]:
    """The sequencers in C and in Verilog with their links, the same in every build."""
    return {path.name: path.read_bytes() for path in (*c_runtime(), *c_link(), *verilog_runtime())}


@cache
def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader(resource_folder("firmware_templates")),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )


def _template(name: str, context: dict[str, Any]) -> bytes:
    return _environment().get_template(name).render(context).encode("ascii")
