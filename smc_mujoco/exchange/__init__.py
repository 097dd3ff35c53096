"""Laws from and to C and FMUs, and the live page. An annex: nothing in the core imports it."""
