"""Results of an identification: the ledger of its errors, tensor, alignment, weak components."""
