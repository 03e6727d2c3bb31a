"""The film's pose, period and bend from a depth stage."""
