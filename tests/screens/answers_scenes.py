"""First answers on the Results page: materials, colours, contrast, measurements and the report."""

from __future__ import annotations

from collections.abc import Callable

from dsl_app.results.cloud.measuring import Measure

from tests.screens.results_scenes import marked, opened, show_tab, wait_for_cloud
from tests.screens.stage import Stage


def answers(stage: Stage) -> None:
    """Which material is where, before and after the classes are chosen, and the colours of the marks."""
    page, _ = marked(stage)
    show_tab(page, page.materials)
    stage.shoot("materials-empty")
    stage.press("From marks", page)
    stage.idle()
    stage.shoot("materials")
    show_tab(page, page.colours)
    stage.shoot("colours")
    stage.shoot_question("report", page.report)


def contrast(stage: Stage) -> None:
    """The histogram that a picture's contrast is set on."""
    page, _ = opened(stage)
    stage.window.do("view_depth")
    stage.click(page.bar.contrast)
    stage.shoot()


def measure(stage: Stage) -> None:
    """A distance and a section in 3D."""
    page, _ = opened(stage)
    stage.window.do("view_cloud")
    wait_for_cloud(stage, page)
    for kind in (Measure.DISTANCE, Measure.SECTION):
        page.cloud.tools.measure.choose(kind)
        page.cloud.tools.measure_chosen.emit(kind)
        for pixel in ((30, 30), (110, 70)):
            page.cloud._measure_pixel(pixel)
        wait_for_cloud(stage, page)
        stage.shoot(kind.name.lower())


SCENES: dict[str, Callable[[Stage], None]] = {
    "answers": answers,
    "answers-contrast": contrast,
    "answers-measure": measure,
}
