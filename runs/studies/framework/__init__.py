"""What a study of cases is made of: cases, records, the run over them, tables and pages."""
