import re
from pathlib import Path

from texture_features.feature_set import FEATURES

README = (Path(__file__).parent.parent / 'README.md').read_text()


def test_the_table_of_the_readme_names_the_features_of_the_catalogue_and_no_others():
    table = README.split('| feature |')[1].split('\n## ')[0]
    first_cells = re.findall(r'^\| (`[^|]+) \|', table, re.MULTILINE)
    named = [name for cell in first_cells for name in re.findall(r'`(\w+)`', cell)]
    missing, foreign = set(FEATURES) - set(named), set(named) - set(FEATURES)
    assert sorted(named) == sorted(FEATURES), (
        f'the table of features in README.md lacks {sorted(missing)} and has {sorted(foreign)} or a name twice, '
        'beside those of the catalogue; add or remove a row'
    )
