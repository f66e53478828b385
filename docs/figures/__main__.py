"""Write the figures of README.md and of all pages anew."""

from docs.figures import figures
from docs.figures.pages import pages, updated

computed = figures()
for page in pages():
    page.write_text(updated(page.read_text(encoding="utf-8"), computed), encoding="utf-8")
