"""The page itself: everything on it is put there by its scripts, from files that lie beside it."""

import html

# nothing comes from elsewhere; `file:` beside 'self' because a page on disk has no origin in some browsers
_POLICY = "default-src 'none'; img-src 'self' file: data:; style-src 'self' file:; script-src 'self' file:"


def page(name: str) -> str:
    """Return the page of the dataset `name` as HTML."""
    title = html.escape(f"uwsim gallery: {name}", quote=True)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<link rel="icon" href="data:,">
<link rel="stylesheet" href="page/style.css">
<script defer src="page/draw.js"></script>
<script defer src="page/frame.js"></script>
<script defer src="page/sheet.js"></script>
<script defer src="index.js"></script>
</head>
<body class="gallery">
<header>
<h1>{title}</h1>
<dl class="facts" id="facts"></dl>
</header>
<main>
<section id="sheet" hidden aria-label="Contact sheet">
<form id="filters" class="filters"></form>
<p id="count" class="note" role="status"></p>
<div id="cards" class="cards"></div>
</section>
<article id="frame" hidden></article>
<noscript><p>This page needs JavaScript: it lists the frames from index.js.</p></noscript>
</main>
<footer>Written by uwsim. The page loads nothing but the files beside it.</footer>
</body>
</html>
"""
