// As Sphinx has it, but a page with the title that is looked for comes before terms and attributes of that name.
var Scorer = { objNameMatch: 11, objPartialMatch: 6, objPrio: { 0: 15, 1: 5, 2: -5 }, objPrioDefault: 0,
  title: 101, partialTitle: 7, term: 5, partialTerm: 2 };
