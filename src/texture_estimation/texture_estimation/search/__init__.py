"""Genetic optimisation of recipes: what is varied, how it is evaluated, and the search itself.

Four things make a search, and any of them may be another one:

- `RecipeSpace`: a recipe, and what of it is varied (a table in YAML, `config/search`).
- `SearchSlides`: the slides, and how they fall into random halves. Slides come from bags
  (`texture_evaluation.optimise.cut_of`) or are plain arrays (`SlideArrays`).
- `SearchTask`: how a recipe is tried. `ClassificationTask()` counts right decisions, `RoughnessTask(grades)` how near
the grades come.
- `ParallelMap`: where the work is done. `serial_map`, `threaded_map()`, `dask_map(address)`.

From slides as plain arrays, `scans`, to a recipe::

    space = RecipeSpace.load('ets-roughness-svm5', load_roughness_recipe('ets-roughness-svm5'))
    task = RoughnessTask(read_grades('ets_roughness'))
    with threaded_map() as parallel_map:
        found = optimise(space, SearchSlides(scans), SearchParams(), task, parallel_map=parallel_map)
    found.best.recipe, found.best.fitness  # a RoughnessRecipe, evaluated by its own regressor on every half

A learner or regressor without a quick surrogate in `surrogates/catalogue.py` is evaluated by itself.
"""
