"""Genetic optimisation of recipes: what is varied, how it is judged, and the search itself.

Four things make a search, and any of them may be another one:

- `RecipeSpace`: a recipe, and what of it is varied (a table in YAML, `config/search`).
- `Division`: the slides, and how they fall into random halves. Slides come from bags
  (`texture_evaluation.optimise.BagSlides`) or are plain arrays (`Scans`).
- `Task`: how a recipe is tried. `TellingApart()` counts right decisions, `Grading(grades)` how near the grades come.
- `Spread`: where the work is done. `in_turn`, `over_cores()`, `over_dask(address)`.

>>> space = RecipeSpace.load('ets-roughness-svm5', load_roughness_recipe('ets-roughness-svm5'))
>>> with over_cores() as spread:
...     found = optimise(space, Division(scans), SearchParams(), Grading(read_grades('ets_roughness')), spread=spread)
>>> found.best.recipe, found.best.fitness  # a RoughnessRecipe, judged by its own head on every half

A learner or head without a quick judge in `judges/catalogue.py` is judged by itself.
"""
