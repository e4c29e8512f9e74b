"""A page from its template, in the colours of the pictures on it."""

import jinja2

from poise.training.pictures.figures.palette import CARDS, variables


def render_page(template: str, **values: object) -> str:
    """Return a template of this package as HTML, rendered with `values` and `colours`."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("poise.training.pictures.report", "templates"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    colours = {scheme: variables(scheme) for scheme in CARDS}
    return environment.get_template(template).render(colours=colours, **values)
