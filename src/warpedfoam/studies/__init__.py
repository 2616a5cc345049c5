"""Studies of few bubbles: one bubble between its plates, the potential that curvature makes."""
