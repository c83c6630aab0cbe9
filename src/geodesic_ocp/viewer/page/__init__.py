"""The interactive page: scenes drawn by Meshcat's three.js, a playback bar, and linked plots.

`fragment(playback)` is what shows one playback, to be put anywhere in the body of a page, several
times if need be; `document(title, body)` is a whole page around such fragments and other HTML, with
the style and the scripts that they need, once. Nothing refers to anything outside the page.
"""
