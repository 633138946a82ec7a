"""Functions of the public interface, which `import adhesion_can` lists; commands use them too."""
