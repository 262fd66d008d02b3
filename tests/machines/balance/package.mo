package Balance "A spring balance: force by deflection, without a motion of its own"
  partial model PartialPivot "Slot: friction of the pivot"
    input Real v(unit="m/s") "Rate of deflection";
    output Real f(unit="N") "Against it";
  end PartialPivot;

  model Pivot "Null version"
    extends PartialPivot;
  equation
    f = 0.0;
  end Pivot;

  model DryFriction "a pivot that rubs"
    extends PartialPivot;
    parameter Real fc(unit="N", min=-10.0, max=10.0) = 0.0 "Force";
  equation
    f = fc*tanh(v/1e-3);
    annotation (__Workbench(effect(
      size="fc", matters=0.05, separation="a slow pull")));
  end DryFriction;

  model Grease "grease that gives way late"
    extends PartialPivot;
    parameter Real d(unit="N.s/m", min=-100.0, max=100.0) = 0.0 "Force per rate";
    parameter Real tau(unit="s", min=0.05, max=1.0) = 0.2 "Time";
    Real late(unit="m/s", start=0.0, fixed=true) "Rate that it feels";
  equation
    tau*der(late) = v - late;
    f = d*late;
    annotation (__Workbench(effect(size="d", matters=1.0, separation="two rates")));
  end Grease;

  model Observer "The balance that observers run on"
    parameter Real c(unit="N/m") = 100.0 "Stiffness";
    input Real s(unit="m") "Deflection";
    input Real v(unit="m/s") "Its rate";
    input Real dc(unit="N/m") "Correction of c";
    output Real F(unit="N") = (c + dc)*s + pivot.f "Force";
    replaceable Pivot pivot(v=v) constrainedby PartialPivot(v=v) "Pivot";
  end Observer;
end Balance;
