"""The editor: a page on which a touch of a term or a rule is answered at once."""
