"""The main window: pages, menus, toasts, tour and log."""
