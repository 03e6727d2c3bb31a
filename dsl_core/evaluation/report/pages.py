"""Self-contained HTML pages from the templates among the resources."""

from __future__ import annotations

from dsl_core.resources import resource_path


def render_page(template: str, **content: object) -> str:
    """Fill a template of ``resources/report``; raises `StoreError` when the templates are not installed."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(resource_path("report")),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    return environment.get_template(template).render(**content)
