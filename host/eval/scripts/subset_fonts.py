"""Cuts typefaces down to the 62 characters of table 3: subset_fonts.py OUT_FOLDER NAME=FONT_FILE ...

The committed files were made with fontTools from Debian 12's packages fonts-dejavu-core 2.37-6 and fonts-lmodern 2.005-1:

    python3 subset_fonts.py ../fonts \
        dejavu-serif=/usr/share/fonts/truetype/dejavu/DejaVuSerif.ttf \
        latin-modern-roman=LM/lmroman10-regular.otf \
        latin-modern-sans=LM/lmsans10-regular.otf \
        latin-modern-mono=LM/lmmono10-regular.otf
"""

import string
import sys

from fontTools import subset
from fontTools.ttLib import TTFont

CHARACTERS = string.ascii_letters + string.digits


def main(out, *fonts):
    for named in fonts:
        name, path = named.split("=", 1)
        options = subset.Options(hinting=False, layout_features=[], name_IDs=[0, 1, 2, 4, 5, 6, 13, 14], notdef_outline=True)
        font = TTFont(path)
        cut = subset.Subsetter(options)
        cut.populate(text=CHARACTERS)
        cut.subset(font)
        # A changed font must not go by its old name (GUST Font License).
        for record in font["name"].names:
            if record.nameID in (1, 4, 6):
                font["name"].setName(f"nirspi-{name}", record.nameID, record.platformID, record.platEncID, record.langID)
        font.save(f"{out}/{name}.{path[-3:]}")


if __name__ == "__main__":
    main(*sys.argv[1:])
