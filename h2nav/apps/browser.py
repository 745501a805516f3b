"""Shows a page that this process serves in the user's browser."""

import threading
import webbrowser


def open_page(url: str) -> None:
    """Opens a page and waits for no browser: one of text runs in the terminal until it is left."""
    threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
