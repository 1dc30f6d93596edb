# Tables, claims, figures, report (to come)
rule tables:
    input: []
rule figures:
    input: []
