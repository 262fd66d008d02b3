within AirSupply.Effects;
model ReservoirHeat "air in the reservoir that is warmed by compression, and cools"
  extends Slots.PartialReservoir;
  parameter Real share(unit="1", min=0.0, max=0.6) = 0.0 "Rise beyond the isothermal one";
  parameter Real tau(unit="s", min=3.0, max=1000.0) = 30.0 "Time constant of the walls";
  Real excess(unit="Pa", start=0.0, fixed=true) "Pressure by warmth";
equation
  der(excess) = share*isothermal - excess/tau;
  actual = isothermal + der(excess);
  annotation (
    __Workbench(effect(
      size="share", matters=0.05,
      shapes(tau={20.0, 80.0}),
      slots={"air"},
      separation="a thermometer in the reservoir")),
    Documentation(info="<html>
<p>What is pressed in warms the air: the pressure rises by <code>share</code> more, and this part decays with
the time constant <code>tau</code>, in which walls take the heat. <code>actual = isothermal + der(excess)</code>,
<code>der(excess) = share*isothermal - excess/tau</code>. The share is 0.4 without walls (adiabatic).</p>
</html>"));
end ReservoirHeat;
