"""What brp is for, in short scripts: ``python -m examples.pushing``, and so on."""
