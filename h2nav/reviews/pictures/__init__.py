"""The pictures of the review's page: their content, independent of drawing."""
