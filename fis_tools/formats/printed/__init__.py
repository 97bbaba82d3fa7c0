"""Tables for documents: Markdown, HTML, LaTeX and CSV."""
