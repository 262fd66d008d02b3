package Lib
  connector Flange Real s(unit="m"); flow Real f(unit="N"); end Flange;
  connector Pin Real v; flow Real i; end Pin;
  connector Signal = input Real;
  expandable connector Bus end Bus;
  type Length = Real(final unit="m");
  type State = enumeration(open, shut);
  partial model Slot input Real u; output Real y; end Slot;
  model Unchanged extends Slot; equation y = u; end Unchanged;
  model Gain extends Slot; parameter Real gain = 2.0; equation y = gain*u; end Gain;
  model Other input Real u; output Real z; equation z = u; end Other;
  model Named extends Slot; output Length label = 1.0; equation y = u; end Named;
  model Part
    parameter Real k(min=0.0) = 1.0;
    final parameter Real n = 3.0;
    parameter State state = State.open;
    Length x(start=1.0, fixed=true);
    Flange a; Pin p;
    replaceable Unchanged slot(u=x) constrainedby Slot(u=x);
    Unchanged firm(u=x);
  protected
    Real hidden = x;
    Flange inside;
  equation
    a.s = x; p.v = 0.0; inside.s = 0.0;
    der(x) = -k*x;
  end Part;
  model Holder "Of a class that may be exchanged"
    replaceable model Law = Unchanged constrainedby Slot;
    model Fixed = Unchanged;
    Law law(u=1.0);
  end Holder;
  model World parameter Real g = 9.81; end World;
  model Falls outer World world; Real w = world.g; end Falls;
end Lib;
