package Stage "A stage on rails"
  import Common = Effects;

  package Effects "What the model leaves out; hides the library of this name"
    model BearingFriction "dry friction in the bearing"
      extends Common.Friction.Dry(coulomb(max=5.0));
      annotation (__Workbench(effect(
        size="coulomb", matters=0.2, separation="a slow run-down")));
    end BearingFriction;

    model Grease "stiff grease"
      extends Common.Friction.Viscous;
      annotation (__Workbench(effect(
        size="damping", matters=0.2, separation="a run-down from two velocities")));
    end Grease;

    model TachoOffset "a tacho whose zero is wrong"
      extends Common.Signals.Offset(offset(unit="m/s", min=-0.1, max=0.1));
      annotation (__Workbench(effect(
        size="offset", matters=1e-3, separation="its reading at standstill")));
    end TachoOffset;

    model TachoGain "a tacho whose gain is wrong"
      extends Common.Signals.Gain(gain(max=0.2));
      annotation (__Workbench(effect(
        size="gain", matters=1e-3, separation="a ruler and a clock")));
    end TachoGain;
  end Effects;

  model Base "What moves"
    parameter Real m(unit="kg") = 2.0 "Mass";
    input Real F(unit="N") "Force";
    output Real v(unit="m/s", start=0.0, fixed=true) "Velocity";
    output Real reading(unit="m/s") = tacho.y "Of the tacho";
    replaceable Common.Friction.Frictionless friction(v=v, load=9.81*m)
      constrainedby Common.Interfaces.Friction(v=v, load=9.81*m) "Rails";
    replaceable Common.Signals.Unchanged tacho(u=v)
      constrainedby Common.Interfaces.Signal(u=v) "Tacho";
  equation
    m*der(v) = F - friction.f;
  end Base;

  annotation (uses(Effects(version="1.0")));
end Stage;
