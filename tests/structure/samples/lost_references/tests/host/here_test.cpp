// docs/page.md
