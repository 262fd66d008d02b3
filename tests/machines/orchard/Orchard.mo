package Orchard "Three trees that drink from one pipe"
  partial model PartialValves "Slot: from openings to flows"
    parameter Integer n = 3 "Valves";
    input Real u[n](each unit="1") "Opening";
    output Real y[n](each unit="1") "Opening that acts";
  end PartialValves;

  model Valves "Null version"
    extends PartialValves;
  equation
    y = u;
  end Valves;

  model Clogging "a valve that is clogged"
    extends PartialValves;
    parameter Real share(unit="1") = 1.0 "Of the water, that it is clogged for";
    parameter Real lost[n](each unit="1", each min=0.0, each max=1.0) = zeros(n) "Of the opening";
  equation
    for i in 1:n loop
      y[i] = u[i]*(1.0 - share*lost[i]);
    end for;
    annotation (__Workbench(effect(size="lost", matters=0.02, separation="a look")));
  end Clogging;

  model Drought "less water in all valves"
    extends PartialValves;
    parameter Real dry(unit="1", min=0.0, max=1.0) = 0.0 "Of the water";
  equation
    y = u*(1.0 - dry);
    annotation (__Workbench(effect(
      size="dry", matters=0.02, after="Clogging", separation="a look at the well")));
  end Drought;

  model Base "Water in the ground"
    parameter Real opening[3](each unit="1") = fill(0.3, 3) "Of the valves";
    output Real water[3](each unit="m3", each start=0.0, each fixed=true) "Of the trees";
    replaceable Valves valves(u=opening) constrainedby PartialValves(u=opening) "Valves";
  equation
    for i in 1:3 loop
      der(water[i]) = valves.y[i];
    end for;
  end Base;
end Orchard;
