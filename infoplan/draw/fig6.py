"""Fig. 6: the terrain, and the final means of both COPOD methods."""

from pathlib import Path

from infoplan.analyse.tables import Selection
from infoplan.draw import style
from infoplan.draw.missions import mission_maps
from infoplan.wording import figure as figure_of

NEEDS = (("PUCT-COPOD", 0.1, "batch"), ("UCT-COPOD", 0.1, "batch"))


def draw(selection: Selection, folder: Path, seed: int) -> list[Path]:
    """Draw Fig. 6 from missions at rho 0.1; returns its files.

    All maps have the colours of the terrain's range; a mean beyond it takes the colour of its end.
    """
    missions = {need[0]: mission_maps(selection, *need, seed) for need in NEEDS}
    first = missions[NEEDS[0][0]]
    unit = style.inert(selection.unit, style.LONGEST_UNIT)
    maps = {f"ground truth, seed {seed}": first.truth}
    for method, mission in missions.items():
        maps[f"{method}, RMSE {figure_of(mission.rmse)} {unit}"] = mission.mean
    with style.journal():
        figure = style.new_figure(style.PAGE, 2.2)
        row = figure.subplots(1, 3, sharey=True)
        for axes, letter, (title, values) in zip(row, "abc", maps.items(), strict=True):
            image = style.show_relief(axes, values, first.extent, like=first.truth)
            style.show_obstacles(axes, first.obstacles)
            style.panel(axes, letter, title)
            if axes is not row[0]:
                axes.set_ylabel("")
        style.colour_bar(image, row[-1], f"elevation ({unit})")
        numbers = first.table[["x1", "x2", "truth"]].assign(
            **{method: mission.mean.ravel() for method, mission in missions.items()}
        )
        return style.save(figure, folder, "fig6", numbers)
