"""The paper's claims, one file a section of the paper, and the audit that judges them."""
