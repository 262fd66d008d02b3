package Tank "A tank that runs out"
  partial model PartialOutflow "Slot: from level to flow"
    input Real h(unit="m") "Level";
    output Real q(unit="m3/s") "Flow";
    output Real P(unit="W") "Power of the flow";
  equation
    P = 9810.0*q*h;
  end PartialOutflow;

  model Orifice "Null version: Torricelli's law"
    extends PartialOutflow;
    parameter Real a(unit="m2") = 1e-3 "Area";
  equation
    q = a*sqrt(2.0*9.81*h);
  end Orifice;

  model Clogging "An orifice that is narrower than drawn"
    extends PartialOutflow;
    parameter Real share(unit="1", min=0.0, max=0.9) = 0.0 "Of the area";
    Orifice drawn(h=h) "As drawn";
  equation
    q = (1.0 - share)*drawn.q;
    annotation (__Workbench(effect(
      size="share", matters=0.02, separation="a look into the orifice")));
  end Clogging;

  model Leak "A leak at the bottom"
    extends PartialOutflow;
    parameter Real area(unit="m2", min=0.0, max=1e-3) = 0.0 "Of the leak";
    Orifice drawn(h=h) "As drawn";
  equation
    q = drawn.q + area*sqrt(2.0*9.81*h);
    annotation (__Workbench(effect(
      size="area", matters=2e-5, separation="a dry floor")));
  end Leak;

  partial model PartialGauge "Slot: from level to reading"
    input Real level(unit="m") "True level";
    output Real reading(unit="m") "What the gauge reads";
  end PartialGauge;

  model TrueGauge "Null version: the gauge reads the truth"
    extends PartialGauge;
  equation
    reading = level;
  end TrueGauge;

  model GaugeOffset "A gauge whose zero is wrong"
    extends PartialGauge;
    parameter Real offset(unit="m", min=-1.0, max=1.0) = 0.0 "Reading when empty";
  equation
    reading = level + offset;
    annotation (__Workbench(effect(
      size="offset", matters=0.01, separation="an empty tank")));
  end GaugeOffset;

  model GaugeGain "A gauge with a wrong gain"
    extends PartialGauge;
    parameter Real gain(unit="1", min=-0.5, max=0.5) = 0.0 "Relative change";
  equation
    reading = (1.0 + gain)*level;
    annotation (__Workbench(effect(
      size="gain", matters=0.01, separation="two levels", after="GaugeOffset")));
  end GaugeGain;

  model Base "A tank"
    parameter Real A(unit="m2", min=0.1) = 2.0 "Area";
    input Real inflow(unit="m3/s") "Flow in";
    output Real h(unit="m", start=1.0, fixed=true) "Level";
    output Real reading(unit="m") = gauge.reading "Reading of the gauge";
    replaceable Orifice orifice(h=h) constrainedby PartialOutflow(h=h) "Outflow";
    replaceable TrueGauge gauge(level=h) constrainedby PartialGauge(level=h) "Gauge";
  equation
    A*der(h) = inflow - orifice.q;
  end Base;
end Tank;
