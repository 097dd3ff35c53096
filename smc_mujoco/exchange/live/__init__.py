"""The live page: plants and laws in a browser, as a folder that any web server can serve."""
