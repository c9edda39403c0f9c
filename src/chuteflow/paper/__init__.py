"""The figures and claims of the paper, computed through the public interface alone."""
