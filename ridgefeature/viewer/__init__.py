"""The web page: look at a scan, click on a ridge, slide its height and width, take it away."""
