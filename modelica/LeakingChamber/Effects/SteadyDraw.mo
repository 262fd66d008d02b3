within LeakingChamber.Effects;
model SteadyDraw "something that draws air, whatever the pressure"
  extends Common.Leaks.Steady(rate(max=1e-2));
  annotation (
    __Workbench(effect(
      size="rate", matters=2e-8,
      separation="the flow at several pressures that are kept")),
    Documentation(info="<html>
<p>A regulator that bleeds.</p>
</html>"));
end SteadyDraw;
