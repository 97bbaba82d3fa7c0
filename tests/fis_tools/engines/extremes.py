"""Small systems of other programs, as texts: each one at an extreme."""

DENORMAL = """\
[System]
Name='den'
Type='mamdani'
Version=2.0
NumInputs=2
NumOutputs=1
NumRules=1
AndMethod='prod'
OrMethod='probor'
ImpMethod='prod'
AggMethod='sum'
DefuzzMethod='centroid'

[Input1]
Name='x'
Range=[0 1]
NumMFs=1
MF1='near':'gaussmf',[0.0186 0.5]

[Input2]
Name='z'
Range=[0 1]
NumMFs=1
MF1='near':'gaussmf',[0.0186 0.5]

[Output1]
Name='y'
Range=[3 4]
NumMFs=1
MF1='a':'trimf',[3 3.2 4]

[Rules]
1 1, 1 (1) : 1
"""
FIRST_POINT = """\
FUNCTION_BLOCK valve
VAR_INPUT
  level : REAL;
END_VAR
VAR_OUTPUT
  valve : REAL;
END_VAR
FUZZIFY level
  TERM low := (0,1) (5,0);
  TERM high := (5,0) (10,1);
END_FUZZIFY
DEFUZZIFY valve
  TERM closed := (0,1) (0.005,0);
  TERM open := (9,0) (10,1);
  METHOD : COA;
  DEFAULT := 3;
END_DEFUZZIFY
RULEBLOCK r
  AND : MIN; ACT : MIN; ACCU : MAX;
  RULE 1 : IF level IS low THEN valve IS closed;
  RULE 2 : IF level IS high THEN valve IS open;
END_RULEBLOCK
END_FUNCTION_BLOCK
"""
DRASTIC = """\
Engine: e
InputVariable: x
  enabled: true
  range: 0.0 1.0
  lock-range: false
  term: a Trapezoid 0.0 0.31 0.33 1.0
InputVariable: y
  enabled: true
  range: 0.0 1.0
  lock-range: false
  term: a Trapezoid 0.0 0.31 0.33 1.0
OutputVariable: z
  enabled: true
  range: 0.0 1.0
  lock-range: false
  aggregation: Maximum
  defuzzifier: Centroid 100
  default: 0.0
  lock-previous: false
  term: c Triangle 0.5 0.75 1.0
RuleBlock: r
  enabled: true
  conjunction: AlgebraicProduct
  disjunction: none
  implication: DrasticProduct
  activation: General
  rule: if x is a and y is a then z is c
"""
SUGENO = """\
[System]
Name='s'
Type='sugeno'
Version=2.0
NumInputs=1
NumOutputs=1
NumRules=1
AndMethod='prod'
OrMethod='probor'
ImpMethod='prod'
AggMethod='sum'
DefuzzMethod='wtaver'

[Input1]
Name='x'
Range=[0 1]
NumMFs=1
MF1='a':'gaussmf',[1 0]

[Output1]
Name='y'
Range=[0 1]
NumMFs=1
MF1='l':'linear',[2 0]

[Rules]
1, 1 (1) : 1
"""
TAKAGI = """\
Engine: e
InputVariable: x
  enabled: true
  range: 0.0 1.0
  lock-range: false
  term: a Ramp -5.0 5.0
  term: b Ramp 5.0 -5.0
OutputVariable: z
  enabled: true
  range: 0.0 1.0
  lock-range: false
  aggregation: none
  defuzzifier: WeightedAverage TakagiSugeno
  default: nan
  lock-previous: false
  term: l Linear 2.0 0.5
  term: f Function x*x+1
RuleBlock: r
  enabled: true
  conjunction: none
  disjunction: none
  implication: none
  activation: General
  rule: if x is a then z is l
  rule: if x is b then z is f
"""
GAPS = """\
[System]
Name='gaps'
Type='mamdani'
Version=2.0
NumInputs=2
NumOutputs=1
NumRules=3
AndMethod='min'
OrMethod='max'
ImpMethod='min'
AggMethod='max'
DefuzzMethod='centroid'

[Input1]
Name='a'
Range=[0 160]
NumMFs=3
MF1='low':'trimf',[0 40 99]
MF2='medium':'trimf',[99 110 127]
MF3='High':'trimf',[127 140 157]

[Input2]
Name='b'
Range=[0 30]
NumMFs=3
MF1='low':'trimf',[26 26.2 26.4]
MF2='medium':'trimf',[28 28.6 28.8]
MF3='High':'trimf',[29.3 29.6 29.9]

[Output1]
Name='class'
Range=[0 1]
NumMFs=2
MF1='no':'trimf',[0 0.25 0.5]
MF2='yes':'trimf',[0.5 0.75 1]

[Rules]
1 1, 1 (1) : 1
2 2, 1 (1) : 1
3 3, 2 (1) : 1
"""
