within LeakingChamber.Effects;
model WarmAtStart "air that is still warm from being filled in"
  extends Interfaces.PartialHeat;
  parameter Real excess(unit="K", min=-20.0, max=60.0) = 0.0 "Over the walls' temperature, at the start";
  parameter Real tau(unit="s", min=0.5, max=60.0) = 10.0 "Time in which 1/e of it is left";
  parameter Real T(unit="K", min=1.0) = 293.15 "Temperature of the walls";
  Real left(unit="1", start=1.0, fixed=true) "Share of the excess";
equation
  tau*der(left) = -left;
  rate = pAir*excess/T*der(left);
  annotation (
    __Workbench(effect(
      size="excess", matters=10.0, shapes(tau={3.0, 10.0, 30.0}),
      separation="the same again some minutes after filling")),
    Documentation(info="<html>
<p>Filling compresses the air that is there, and warms it by tens of kelvin; the walls take that up
within seconds, within half a minute where there is no draught. Ten kelvin
that are left when the chamber is closed are usual, and no finding.</p>
</html>"));
end WarmAtStart;
