"""The pictures of the review's page: what is drawn, without a word of how."""
