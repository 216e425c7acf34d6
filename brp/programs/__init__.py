"""The paper's programs as declarations, a file for each, to be laid beside the paper's page."""
